import { useEffect, useState, type FormEvent } from "react";
import { useTranslation } from "react-i18next";
import type { Mission } from "../api/types";
import { useUnits } from "../app/preferences";
import { Button } from "../controls/Button";
import { QuantityField } from "../controls/QuantityField";
import { Pill } from "../controls/StatusPill";
import { useReportText } from "../i18n/use_report_text";
import { isFinal, TONES } from "../live/order";
import { useIsConnected } from "../live/use_live";
import { orderedSpeed } from "../planning/speed_limits";
import { speedRange } from "../units/limits";
import { useLastSpeed, useSpeedOrder, type SpeedOrder } from "./use_speed_order";

/** Changes the speed of a mission in flight; `open` is called when a person begins to, `done` when it is obeyed. */
export function SpeedForm({ mission, open, done }: { mission: Mission; open?: () => void; done?: () => void }) {
  const { t } = useTranslation();
  const [isOpen, setOpen] = useState(false);
  if (isOpen) return <OpenForm mission={mission} done={done} />;
  return (
    <Button
      icon="speed"
      onClick={() => {
        setOpen(true);
        open?.();
      }}
    >
      {t("speed.open")}
    </Button>
  );
}

/** The speed that is flown now, to be changed, and what became of the order. */
function OpenForm({ mission, done }: { mission: Mission; done: (() => void) | undefined }) {
  const { t } = useTranslation();
  const units = useUnits();
  const isConnected = useIsConnected();
  const flown_m_s = useLastSpeed(mission.vehicle_id);
  const [chosen_m_s, choose] = useState<number | null | undefined>(undefined);
  const [order, send] = useSpeedOrder(mission.vehicle_id);
  const isDone = order?.state === "done";
  useEffect(() => {
    if (isDone) done?.();
  }, [isDone, done]);
  const speed_m_s = chosen_m_s !== undefined
    ? chosen_m_s
    : flown_m_s === null ? (mission.maximum_speed ?? null) : (flown_m_s ?? null);
  const ordered = orderedSpeed(speed_m_s);
  /** The same speed is not ordered again while the order is on its way. */
  const isOrdered = order !== null && !isFinal(order.state) && order.speed_m_s === ordered;
  const unit = units.speedInput;
  const range = speedRange(units, t);
  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (ordered !== null && !isOrdered) send(ordered);
  };
  return (
    <div className="speed-form">
      <form onSubmit={submit} noValidate>
        <QuantityField
          label={t("plans.maximum_speed")}
          unit={unit}
          value={speed_m_s}
          change={choose}
          hint={t("editor.out_of_range", { range })}
          error={ordered === null && (chosen_m_s !== undefined || speed_m_s !== null) ? t("editor.out_of_range", { range }) : undefined}
        />
        <Button kind="primary" icon="speed" type="submit" isBusy={isOrdered} disabled={ordered === null || !isConnected}>
          {t("speed.change")}
        </Button>
      </form>
      {!isConnected && <p className="muted small">{t("speed.offline")}</p>}
      <div aria-live="polite">{order && <Outcome order={order} />}</div>
    </div>
  );
}

function Outcome({ order }: { order: SpeedOrder }) {
  const { t } = useTranslation();
  const reportText = useReportText();
  const units = useUnits();
  return (
    <div className="speed-outcome">
      <strong>{units.speed(order.speed_m_s)}</strong>
      <Pill tone={TONES[order.state]}>{t(`order.${order.state}`)}</Pill>
      <p className="small muted">
        {t(order.state === "done" ? "speed.done_text" : `order.${order.state}_text`)}
        {order.reason && <> {t("error.reason", { reason: reportText(order.reason) })}</>}
      </p>
    </div>
  );
}
