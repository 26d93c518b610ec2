import { useState } from "react";
import { useTranslation } from "react-i18next";
import { LAND_HERE, RETURN_HOME, type StopKind } from "../api/resources";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { HoldButton } from "../controls/HoldButton";
import { Icon } from "../controls/Icon";
import { Notice } from "../controls/states";
import { SelectField } from "../controls/fields";
import { Pill, type Tone } from "../controls/StatusPill";
import { isAirborne, statusOf } from "../live/vehicle_status";
import { useIsConnected, useLive } from "../live/use_live";
import { useStopOrders, type OrderState, type StopOrder } from "./use_stop_orders";

const ALL = "all";
const TONES: Record<OrderState, Tone> = {
  sending: "neutral", queued: "active", accepted: "active", done: "good",
  refused: "bad", expired: "bad", idle: "neutral", failed: "bad",
};

/** Lands a vehicle or calls it home: says what will happen, then what happened. */
export function StopDialog({ vehicleId, close }: { vehicleId: number | null; close: () => void }) {
  const { t } = useTranslation();
  const isConnected = useIsConnected();
  const vehicles = useLive((state) => state.vehicles);
  const [target, setTarget] = useState(vehicleId === null ? ALL : String(vehicleId));
  const [orders, send] = useStopOrders();
  const ids = target === ALL ? [...vehicles.keys()] : [Number(target)];
  const flying = [...vehicles.values()].filter(({ vehicle }) => isAirborne(vehicle)).length;

  const order = (kind: StopKind) => send(ids, kind);
  return (
    <Dialog title={t("stop.title")} close={close} kind="danger">
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
      <div className="stop-choices">
        <section>
          <HoldButton
            className="hold-danger"
            hint={t("stop.hold")}
            disabled={!isConnected || ids.length === 0}
            act={() => order(LAND_HERE)}
          >
            <Icon name="land" size={26} /> {t("stop.land")}
          </HoldButton>
          <p>{t("stop.land_text")}</p>
        </section>
        <section>
          <HoldButton
            className="hold-home"
            hint={t("stop.hold")}
            disabled={!isConnected || ids.length === 0}
            act={() => order(RETURN_HOME)}
          >
            <Icon name="home" size={26} /> {t("stop.home")}
          </HoldButton>
          <p>{t("stop.home_text")}</p>
        </section>
      </div>
      <p className="muted small">{t("stop.expiry")}</p>
      <ul className="stop-orders" aria-live="assertive">
        {orders.map((one) => (
          <OrderRow key={one.key} order={one} />
        ))}
      </ul>
      <footer className="dialog-actions">
        <Button onClick={close}>{t("action.close")}</Button>
      </footer>
    </Dialog>
  );
}

function OrderRow({ order }: { order: StopOrder }) {
  const { t } = useTranslation();
  return (
    <li>
      <div>
        <strong>{t("vehicle.name", { id: order.vehicleId })}</strong>
        <span>{t(order.kind === LAND_HERE ? "stop.land" : "stop.home")}</span>
        <Pill tone={TONES[order.state]}>{t(`order.${order.state}`)}</Pill>
      </div>
      <p className="small">
        {t(`order.${order.state}_text`)}
        {order.reason && <> {t("error.reason", { reason: order.reason })}</>}
      </p>
    </li>
  );
}
