import { useEffect, useRef, useState, type ReactNode } from "react";
import { useTranslation } from "react-i18next";
import { useReportText } from "../i18n/use_report_text";
import type { Vehicle } from "../api/types";
import { LAND_HERE, PAUSE, RESUME, RETURN_HOME, type StopKind } from "../api/resources";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { HoldButton } from "../controls/HoldButton";
import { Icon, type IconName } from "../controls/Icon";
import { Notice } from "../controls/states";
import { SelectField } from "../controls/fields";
import { Pill } from "../controls/StatusPill";
import { textKeyOf, TONES } from "../live/order";
import { isAirborne, statusOf } from "../live/vehicle_status";
import { useIsConnected, useLive } from "../live/use_live";
import { useStopOrders, type StopOrder } from "./use_stop_orders";

const ALL = "all";

type ChoiceName = "land" | "home" | "pause" | "resume";

interface Choice {
  kind: StopKind;
  name: ChoiceName;
  icon: IconName;
  className: string;
}

const HOLD_HERE: Choice = { kind: PAUSE, name: "pause", icon: "pause", className: "hold-plain" };
const FLY_ON: Choice = { kind: RESUME, name: "resume", icon: "play", className: "hold-plain" };
const ENDINGS: readonly Choice[] = [
  { kind: RETURN_HOME, name: "home", icon: "home", className: "hold-home" },
  { kind: LAND_HERE, name: "land", icon: "land", className: "hold-danger" },
];

/** Pauses a vehicle, calls it home or lands it: says what will happen, then what happened. */
export function StopDialog({ vehicleId, close }: { vehicleId: number | null; close: () => void }) {
  const { t } = useTranslation();
  const reportText = useReportText();
  const isConnected = useIsConnected();
  const vehicles = useLive((state) => state.vehicles);
  const [target, setTarget] = useState(vehicleId === null ? ALL : String(vehicleId));
  const [orders, send] = useStopOrders();
  const ids = target === ALL ? [...vehicles.keys()] : [Number(target)];
  const chosen = ids.map((id) => vehicles.get(id)?.vehicle);
  const isPaused = chosen.some((vehicle) => vehicle?.activity === "paused");
  const isOperator = useIsOperator();
  const choices = [HOLD_HERE, ...(isPaused && isOperator ? [FLY_ON] : []), ...ENDINGS];
  const warned = chosen.flatMap((one) => (one?.warning ? [one] : []));
  const lost = chosen.flatMap((one) => (one && isLost(one) ? [one.vehicle_id] : []));
  const piloted = chosen.flatMap((one) => (one && one.armed && one.activity === "manual" ? [one.vehicle_id] : []));
  const flying = [...vehicles.values()].filter(({ vehicle }) => isAirborne(vehicle)).length;

  // One that comes while a button is held would move it away below the finger, and end the hold
  const [isPressed, setPressed] = useState(false);
  const notices = useRef<ReactNode>(null);
  if (!isPressed) {
    notices.current = (
      <>
        {lost.map((id) => (
          <Notice key={id} kind="info">{t("stop.lost", { id })}</Notice>
        ))}
        {piloted.map((id) => (
          <Notice key={id} kind="info">{t("stop.piloted", { id })}</Notice>
        ))}
        {warned.map((one) => (
          <Notice key={one.vehicle_id} kind="info">
            {t("vehicle.name", { id: one.vehicle_id })}: {reportText(one.warning ?? "")}
          </Notice>
        ))}
      </>
    );
  }

  // What becomes of the newest order, the first one, may lie below the edge of a phone: also when the
  // buttons above it change with it
  const list = useRef<HTMLUListElement>(null);
  const newest = orders[0] === undefined ? "" : `${orders[0].key} ${orders[0].state} ${choices.length}`;
  const shown = useRef("");
  useEffect(() => {
    if (isPressed || newest === shown.current) return;
    shown.current = newest;
    list.current?.firstElementChild?.scrollIntoView({ block: "nearest" });
  }, [isPressed, newest]);

  const order = (kind: StopKind) => send(ids, kind);
  return (
    <Dialog title={t("stop.title")} close={close} kind="stop">
      <SelectField
        label={t("stop.target")}
        value={target}
        onChange={(event) => setTarget(event.target.value)}
      >
        <option value={ALL}>{t("stop.all", { count: vehicles.size, flying })}</option>
        {[...vehicles.values()].map(({ vehicle }) => (
          <option key={vehicle.vehicle_id} value={vehicle.vehicle_id}>
            {t("vehicle.name", { id: vehicle.vehicle_id })} · {t(`vehicle.${statusOf(vehicle)}`)}
          </option>
        ))}
      </SelectField>
      {!isConnected && <Notice kind="error">{t("stop.offline")}</Notice>}
      {isConnected && ids.length === 0 && <Notice kind="info">{t("fleet.empty_title")}</Notice>}
      {notices.current}
      <div
        className="stop-choices"
        onPointerDown={() => setPressed(true)}
        onPointerUp={() => setPressed(false)}
        onPointerCancel={() => setPressed(false)}
        onPointerLeave={() => setPressed(false)}
      >
        {choices.map(({ kind, name, icon, className }) => (
          <section key={name}>
            <HoldButton
              className={className}
              hint={t("stop.hold")}
              disabled={!isConnected || ids.length === 0}
              act={() => order(kind)}
            >
              <Icon name={icon} size={26} /> {t(`stop.${name}`)}
            </HoldButton>
            <p>{t(`stop.${name}_text`)}</p>
          </section>
        ))}
      </div>
      <p className="muted small">{t("stop.expiry")}</p>
      <ul className="stop-orders" aria-live="assertive" ref={list}>
        {orders.map((one) => (
          <OrderRow key={one.key} order={one} isLost={isLost(vehicles.get(one.vehicleId)?.vehicle)} />
        ))}
      </ul>
      <div className="dialog-actions">
        <Button onClick={close}>{t("action.close")}</Button>
      </div>
    </Dialog>
  );
}

/** Whether nothing is received from a vehicle: nobody can see whether it obeys. */
function isLost(vehicle: Vehicle | undefined): boolean {
  return vehicle?.link_state === "lost" || vehicle?.link_state === "stale";
}

function OrderRow({ order, isLost }: { order: StopOrder; isLost: boolean }) {
  const { t } = useTranslation();
  const text = textKeyOf(order, ENDINGS.some(({ kind }) => kind === order.kind), !isLost);
  const reportText = useReportText();
  return (
    <li>
      <div>
        <strong>{t("vehicle.name", { id: order.vehicleId })}</strong>
        <span>{t(`stop.${nameOf(order.kind)}`)}</span>
        <Pill tone={TONES[order.state]}>{t(`order.${order.state}`)}</Pill>
      </div>
      <p className="small">
        {t(`order.${text}_text`)}
        {order.reason && <> {t("error.reason", { reason: reportText(order.reason) })}</>}
      </p>
    </li>
  );
}

function nameOf(kind: StopKind): ChoiceName {
  return [HOLD_HERE, FLY_ON, ...ENDINGS].find((choice) => choice.kind === kind)?.name ?? "land";
}
