import { useTranslation } from "react-i18next";
import { listFlights } from "../api/resources";
import type { Flight } from "../api/types";
import { useUnits } from "../app/preferences";
import { linkTo } from "../app/route";
import { MoreRows } from "../controls/MoreRows";
import { Empty, Loaded } from "../controls/states";
import { Pill, StatusPill } from "../controls/StatusPill";
import { useResource } from "../live/use_resource";
import { Missing } from "./Missing";

/** Every flight that was recorded, the newest first. */
export default function Flights() {
  const { t } = useTranslation();
  const flights = useResource(listFlights);
  return (
    <div className="screen">
      <header className="screen-head">
        <h1>{t("flights.title")}</h1>
      </header>
      <div className="card">
        <Loaded
          resource={flights}
          missing={<Missing />}
          empty={<Empty icon="flight" title={t("flights.empty_title")} text={t("flights.empty_text")} />}
        >
          {(rows) => (
            <MoreRows rows={rows}>{(flight) => <FlightRow key={flight.id} flight={flight} />}</MoreRows>
          )}
        </Loaded>
      </div>
    </div>
  );
}

function FlightRow({ flight }: { flight: Flight }) {
  const { t } = useTranslation();
  return (
    <li>
      <a className="row-main" {...linkTo(`flights/${flight.id}`)}>
        <strong>{t("flights.flight", { id: flight.id })}</strong>
        <span>
          {[t("vehicle.name", { id: flight.vehicle_id }), flight.plan_name].filter(Boolean).join(" · ")}
        </span>
      </a>
      <FlightFigures flight={flight} />
      {flight.alarms > 0 && <Pill tone="warning">{`${t("flights.alarms")}: ${flight.alarms}`}</Pill>}
      {flight.mission_status_id && <StatusPill status={flight.mission_status_id} />}
    </li>
  );
}

/** Start, duration, distance and pictures of a flight. */
export function FlightFigures({ flight }: { flight: Flight }) {
  const { t } = useTranslation();
  const units = useUnits();
  const ended = flight.ended_at === null ? Date.now() : Date.parse(flight.ended_at);
  const figures: [string, string][] = [
    [t("flights.started"), units.time(flight.started_at)],
    [t("flights.duration"), units.elapsed(ended - Date.parse(flight.started_at))],
    [t("flights.distance"), units.distance(flight.distance_m)],
    [t("flights.pictures"), String(flight.pictures)],
  ];
  return (
    <dl className="row-figures">
      {figures.map(([label, value]) => (
        <div key={label}>
          <dt>{label}</dt>
          <dd>{value}</dd>
        </div>
      ))}
    </dl>
  );
}
