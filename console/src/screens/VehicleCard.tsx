import { memo, use, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { useReportText } from "../i18n/use_report_text";
import { useUnits } from "../app/preferences";
import { linkTo } from "../app/route";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { Icon, type IconName } from "../controls/Icon";
import { Pill, type Tone } from "../controls/StatusPill";
import { StopContext } from "../controls/StopButton";
import { useIsNear } from "../controls/use_is_near";
import { serverAheadMs } from "../api/server_clock";
import type { Vehicle } from "../api/types";
import type { Tracked } from "../live/state";
import type { Units } from "../units/units";
import type { Waiting } from "../live/queue";
import { useIsConnected, useNow } from "../live/use_live";
import type { Running } from "../live/use_plans";
import { isBatteryLow, statusOf, type VehicleStatus } from "../live/vehicle_status";
import { LivePicture } from "./LivePicture";
import { ReleaseForm } from "./ReleaseForm";
import { SpeedForm } from "./SpeedForm";
import { WaitingPlans } from "./WaitingPlans";

const TONES: Record<VehicleStatus, Tone> = {
  lost: "bad", stale: "warning", held: "warning", on_mission: "active", flying: "active",
  paused: "warning", holding: "warning", return_or_land: "active", failsafe: "bad", manual: "warning",
  armed: "warning", ready: "good",
};

/** What one vehicle is doing: its state, its figures, its mission and its own stop.
 *
 * Far from what the list shows, its figures and its mission are left out: a fleet of fifty would
 * take a slow tablet more than a second to draw.
 */
export const VehicleCard = memo(function VehicleCard({ tracked, running, waiting, isSelected, isShownAtFirst, select }: {
  tracked: Tracked;
  running: Running | null;
  waiting: readonly Waiting[];
  isSelected: boolean;
  isShownAtFirst: boolean;
  select: (vehicleId: number) => void;
}) {
  const { t } = useTranslation();
  const reportText = useReportText();
  const stop = use(StopContext);
  const isOperator = useIsOperator();
  const card = useRef<HTMLElement>(null);
  const isNear = useIsNear(card, isShownAtFirst);
  /** A form that a person has opened stays, with what became of the order, while the card is scrolled away. */
  const [changesSpeed, setChangesSpeed] = useState(false);
  const { vehicle } = tracked;
  const status = statusOf(vehicle);
  const isConnected = useIsConnected();
  const name = t("vehicle.name", { id: vehicle.vehicle_id });
  return (
    <article ref={card} className={`vehicle-card ${isSelected ? "is-selected" : ""}`} aria-label={name}>
      <header>
        <button type="button" className="vehicle-name" onClick={() => select(vehicle.vehicle_id)} aria-pressed={isSelected}>
          <h2>{name}</h2>
        </button>
        <Pill tone={isConnected ? TONES[status] : "neutral"}>{t(`vehicle.${status}`)}</Pill>
      </header>
      {isNear ? <Figures tracked={tracked} /> : <div className="figures-left-out" />}
      {isSelected && <LivePicture vehicleId={vehicle.vehicle_id} />}
      {vehicle.warning && <p className="vehicle-warning">{reportText(vehicle.warning)}</p>}
      {isNear && running && <Progress running={running} />}
      {(isNear || changesSpeed) && running && isOperator && (
        <SpeedForm
          key={`${running.plan.id}-${running.mission.mission_id}`}
          mission={running.mission}
          open={() => setChangesSpeed(true)}
        />
      )}
      {isNear && <WaitingPlans vehicleId={vehicle.vehicle_id} waiting={waiting} />}
      {vehicle.held && <ReleaseForm vehicleId={vehicle.vehicle_id} reason={vehicle.held.reason} />}
      {vehicle.armed && (
        <Button kind="danger" icon="stop" onClick={() => stop?.(vehicle.vehicle_id)}>
          {t("vehicle.stop")}
        </Button>
      )}
    </article>
  );
});

function Figures({ tracked }: { tracked: Tracked }) {
  const { t } = useTranslation();
  const units = useUnits();
  const { vehicle, motion } = tracked;
  return (
    <dl className="figures">
      <Figure icon="height" label={t("vehicle.height")} value={units.height(vehicle.altitude)} />
      <Figure icon="speed" label={t("vehicle.speed")} value={units.speed(motion.speed_m_s)} />
      <Figure
        icon="battery"
        label={t("vehicle.battery")}
        value={units.percentage(vehicle.battery_percentage)}
        more={timeLeft(units, vehicle)}
        isBad={isBatteryLow(vehicle)}
      />
      <Figure
        icon="locate"
        label={t("vehicle.gps")}
        value={vehicle.gps_fix ? t(`gps.${vehicle.gps_fix}`, { defaultValue: vehicle.gps_fix }) : "–"}
        more={
          typeof vehicle.satellites === "number"
            ? t("gps.satellites", { count: vehicle.satellites })
            : ""
        }
        isBad={vehicle.gps_fix === "none" || vehicle.gps_fix === "2d"}
      />
      <LinkAge heardAtMs={tracked.heardAtMs} isBad={vehicle.link_state !== "connected"} />
    </dl>
  );
}

/** The flight time that is left; nothing while the motors stand, when it says hours. */
function timeLeft(units: Units, vehicle: Vehicle): string {
  const left_s = vehicle.battery_time_remaining;
  return vehicle.armed && typeof left_s === "number" ? units.duration(left_s * 1000) : "";
}

function Figure({ icon, label, value, more = "", isBad = false }: {
  icon: IconName;
  label: string;
  value: string;
  /** What stands smaller beside the value. */
  more?: string;
  isBad?: boolean;
}) {
  return (
    <div className={isBad ? "is-bad" : ""}>
      <dt>
        <Icon name={icon} size={16} />
        {label}
      </dt>
      <dd>
        {value} {more && <small>{more}</small>}
      </dd>
    </div>
  );
}

/** Renders by itself each second, so that the card need not. */
function LinkAge({ heardAtMs, isBad }: { heardAtMs: number; isBad: boolean }) {
  const { t } = useTranslation();
  const units = useUnits();
  const now = useNow();
  return <Figure icon="link" label={t("vehicle.link")} value={units.duration(now + serverAheadMs() - heardAtMs)} isBad={isBad} />;
}

function Progress({ running }: { running: Running }) {
  const { t } = useTranslation();
  const commands = running.mission.command_array;
  const ended = commands.filter((one) => one.command_status_id >= 3).length;
  const present = commands.find((one) => one.command_status_id === 2);
  const name = running.plan.name ?? t("plans.unnamed", { id: running.plan.id });
  return (
    <a className="vehicle-mission" {...linkTo(`plans/${running.plan.id}`)}>
      <strong>{name}</strong>
      <progress max={commands.length} value={ended} aria-label={t("fleet.progress")} />
      <span className="muted small">
        {t("fleet.done_of", { done: ended, all: commands.length })}
        {present && ` · ${t(`command.${present.command_type_id}`)}`}
      </span>
    </a>
  );
}
