import { useId, useState } from "react";
import { useTranslation } from "react-i18next";
import type { FlightObservations } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { Button } from "../../controls/Button";
import { SelectField } from "../../controls/fields";
import { Icon } from "../../controls/Icon";
import { Empty, Loaded } from "../../controls/states";
import { COLOURS, colourOf, type Kind, type Measurement } from "../../flights/measurements";
import type { Resource } from "../../live/use_resource";

const ROWS = 20;

export interface Choice {
  kinds: Kind[];
  kind: Kind | null;
  choose: (name: string) => void;
  /** The measurement that is marked on the map. */
  chosen: string | null;
  mark: (measurement: Measurement) => void;
}

/** The name by which a kind is chosen. */
export const nameOf = (kind: Kind): string => `${kind.property} ${kind.unit}`;

/** What a flight has measured: a choice of kind, its legend, its values and a file of all. */
export function Measurements({ flightId, resource, choice }: {
  flightId: number;
  resource: Resource<FlightObservations[]>;
  choice: Choice;
}) {
  const { t } = useTranslation();
  const { kinds, kind, choose } = choice;
  const title = useKindTitle();
  return (
    <>
      <h2>{t("flights.measurements")}</h2>
      <Loaded resource={resource} empty={<Empty icon="fit" title={t("flights.no_measurements")} />}>
        {() => (
          <>
            <SelectField
              label={t("flights.measured")}
              value={kind ? nameOf(kind) : ""}
              onChange={(event) => choose(event.target.value)}
            >
              <option value="">{t("flights.hide_measurements")}</option>
              {kinds.map((one) => (
                <option key={nameOf(one)} value={nameOf(one)}>
                  {title(one)} ({one.measurements.length})
                </option>
              ))}
            </SelectField>
            {kind && <Legend kind={kind} title={title(kind)} />}
            {kind && <Values key={nameOf(kind)} kind={kind} title={title(kind)} choice={choice} />}
            <div className="actions">
              <a className="button button-plain" href={`/flights/${flightId}/observations?format=csv`} download>
                <Icon name="download" /> {t("flights.measurements_csv")}
              </a>
            </div>
          </>
        )}
      </Loaded>
    </>
  );
}

/** Gives the name of a quantity in the present language; one without a name keeps the vehicle's. */
function useKindTitle(): (kind: Kind) => string {
  const { t } = useTranslation();
  return ({ property }) => t(`quantity.${property}`, { defaultValue: property.replaceAll("_", " ") });
}

/** The legend on the map. */
export function MapLegend({ kind }: { kind: Kind }) {
  const title = useKindTitle()(kind);
  return (
    <>
      <strong>{title}</strong>
      <Legend kind={kind} title={title} />
    </>
  );
}

/** The colours of a kind and their values; each instance has a gradient of its own. */
function Legend({ kind, title }: { kind: Kind; title: string }) {
  const units = useUnits();
  const gradient = useId();
  const ends = [kind.lowest, (kind.lowest + kind.highest) / 2, kind.highest];
  return (
    <figure className="legend" aria-label={title}>
      <svg viewBox="0 0 100 6" preserveAspectRatio="none" aria-hidden="true">
        <defs>
          <linearGradient id={gradient}>
            {COLOURS.map((colour, index) => (
              <stop key={colour} offset={index / (COLOURS.length - 1)} stopColor={colour} />
            ))}
          </linearGradient>
        </defs>
        <rect width="100" height="6" fill={`url(#${gradient})`} />
      </svg>
      <figcaption>
        {(kind.highest > kind.lowest ? ends : ends.slice(1, 2)).map((value) => (
          <span key={value}>{units.measured(value, kind.unit)}</span>
        ))}
      </figcaption>
    </figure>
  );
}

function Values({ kind, title, choice }: { kind: Kind; title: string; choice: Choice }) {
  const { t } = useTranslation();
  const units = useUnits();
  const [shown, setShown] = useState(ROWS);
  const left = kind.measurements.length - shown;
  return (
    <div className="card">
      <table className="table measurements">
        <caption className="visually-hidden">{title}</caption>
        <thead>
          <tr>
            <th scope="col">{t("flights.time")}</th>
            <th scope="col">{t("flights.height")}</th>
            <th scope="col">{t("flights.value")}</th>
          </tr>
        </thead>
        <tbody>
          {kind.measurements.slice(0, shown).map((one) => (
            <tr key={one.key} className={one.key === choice.chosen ? "is-chosen" : ""}>
              <td>
                <button
                  type="button"
                  className="table-button"
                  aria-pressed={one.key === choice.chosen}
                  title={one.sensor}
                  onClick={() => choice.mark(one)}
                >
                  {units.clock(one.at_ms)}
                </button>
              </td>
              <td>{units.height(one.height_m)}</td>
              <td>
                <svg className="swatch" viewBox="0 0 12 12" aria-hidden="true">
                  <circle cx="6" cy="6" r="5" fill={colourOf(one.value, kind)} />
                </svg>
                {units.measured(one.value, kind.unit)}
              </td>
            </tr>
          ))}
        </tbody>
      </table>
      {left > 0 && (
        <div className="more-rows">
          <Button icon="down" onClick={() => setShown(shown + ROWS)}>
            {t("action.more", { count: left })}
          </Button>
        </div>
      )}
    </div>
  );
}
