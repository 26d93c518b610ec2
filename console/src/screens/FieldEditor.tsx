import { lazy, Suspense, useMemo, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { RequestError } from "../api/client";
import { createField, deleteField, listFields, replaceField } from "../api/resources";
import type { StoredField } from "../api/types";
import { useUnits } from "../app/preferences";
import { go, linkTo } from "../app/route";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { TextField } from "../controls/fields";
import { Icon } from "../controls/Icon";
import { ErrorNotice, Notice, Skeleton } from "../controls/states";
import { useUndoKeys } from "../controls/use_undo_keys";
import { describeError } from "../i18n/describe_error";
import { useLive } from "../live/use_live";
import { asRequestError, useResource } from "../live/use_resource";
import { farmExtent } from "../map/farm_extent";
import { collection, fieldFeatures } from "../map/features";
import { begin, change as record, redo, undo } from "../planning/history";
import {
  draftOf, EMPTY, fieldArea_m2, isComplete, nextCorner, outlineOf, presentRing, ringOf, ringOfFault,
  withCorner, withMovedCorner, withoutCorner, withRing, type Corner, type Outline, type Ring, type RingName,
} from "../planning/outline";
import { CornerForm } from "./CornerForm";
import { RingList } from "./RingList";
import { useCornerSymbols } from "./use_corner_symbols";
import { useFleetSymbols } from "./use_fleet_symbols";

const FarmMap = lazy(() => import("../map/FarmMap"));
const DEFAULT_START: Corner = [40.4434, -3.7382];
const nothing = () => undefined;

/** A new field, or one that is stored. */
export default function FieldEditor({ id }: { id: number | null }) {
  const fields = useResource(listFields);
  if (fields.value === null) {
    return (
      <div className="screen">
        {fields.error ? <ErrorNotice error={fields.error} retry={fields.reload} /> : <Skeleton />}
      </div>
    );
  }
  const field = fields.value.find((one) => one.id === id) ?? null;
  if (id !== null && field === null) {
    return (
      <div className="screen">
        <ErrorNotice error={new RequestError(404, "")} retry={fields.reload} />
      </div>
    );
  }
  return <Editor field={field} others={fields.value.filter((one) => one.id !== id)} />;
}

function Editor({ field, others }: { field: StoredField | null; others: StoredField[] }) {
  const { t } = useTranslation();
  const units = useUnits();
  const vehicles = useLive((state) => state.vehicles);
  const [name, setName] = useState(field?.name ?? "");
  const [history, setHistory] = useState(() => begin(field === null ? EMPTY : outlineOf(field)));
  const [chosenRing, setChosenRing] = useState<RingName>("boundary");
  const [selected, setSelected] = useState<number | null>(null);
  const [error, setError] = useState<RequestError | null>(null);
  const [isBusy, setBusy] = useState(false);
  const dragged = useRef<number | null>(null);
  const outline = history.present;
  const ringName = presentRing(outline, chosenRing);
  const ring = ringOf(outline, ringName);

  const change = (update: (present: Outline) => Outline, isContinued = false) => {
    setHistory((all) => record(all, update(all.present), isContinued));
    setError(null);
  };
  const changeRing = (update: (present: Ring) => Ring, isContinued = false) =>
    change((present) => withRing(present, ringName, update(ringOf(present, ringName))), isContinued);
  const step = (to: typeof undo) => {
    setHistory((all) => to(all));
    setSelected(null);
    setError(null);
  };
  useUndoKeys(() => step(undo), () => step(redo));
  const choose = (chosen: RingName) => {
    setChosenRing(chosen);
    setSelected(null);
  };
  const add = (corner: Corner, after?: number) => {
    changeRing((present) => withCorner(present, corner, after));
    setSelected(after === undefined ? ring.length : after + 1);
  };
  const remove = (index: number) => {
    changeRing((present) => withoutCorner(present, index));
    setSelected(null);
  };
  const move = (index: number, corner: Corner, isDropped = true) => {
    const isContinued = dragged.current === index;
    dragged.current = isDropped ? null : index;
    changeRing((present) => withMovedCorner(present, index, corner), isContinued);
  };
  const save = () => {
    setBusy(true);
    const draft = draftOf(name, outline);
    (field === null ? createField(draft) : replaceField(field.id, draft))
      .then(() => go("fields"))
      .catch((reason: unknown) => {
        const refusal = asRequestError(reason);
        setError(refusal);
        const first = refusal.faults.map((fault) => ringOfFault(fault.path)).find((one) => one !== null);
        if (first) choose(first);
      })
      .finally(() => setBusy(false));
  };

  const fleet = useFleetSymbols(others, null, nothing);
  const corners = useCornerSymbols(ringName, ring, selected, { select: setSelected, add, remove, move });
  const symbols = useMemo(() => [...fleet, ...corners], [fleet, corners]);
  const layers = useMemo(
    () => ({
      fields: collection([
        ...fieldFeatures(others).features,
        ...fieldFeatures([outline], "drawn").features,
      ]),
    }),
    [others, outline],
  );
  const extent = useMemo(
    () => farmExtent(field === null ? others : [field], field === null ? vehicles.values() : []),
    [field, others, vehicles],
  );
  const start = (): Corner => {
    const [vehicle] = [...vehicles.values()].map((one) => one.vehicle);
    const corner = outline.boundary[0] ?? others[0]?.boundary[0];
    if (corner) return [corner[0] ?? 0, corner[1] ?? 0];
    return typeof vehicle?.latitude === "number" && typeof vehicle.longitude === "number"
      ? [vehicle.latitude, vehicle.longitude]
      : DEFAULT_START;
  };
  const otherFaults = (error?.faults ?? []).filter(
    (fault) => ringOfFault(fault.path) === null && fault.path !== "name",
  );

  return (
    <div className="split">
      <div className="split-map is-drawn-on">
        <Suspense fallback={<div className="farm-map" />}>
          <FarmMap
            layers={layers}
            symbols={symbols}
            extent={extent}
            label={t("map.label")}
            click={(longitude, latitude) => add([latitude, longitude])}
          />
        </Suspense>
        {ring.length < 3 && <p className="map-hint">{t("fields.draw_hint")}</p>}
      </div>
      <section className="split-side">
        <a className="back-link" {...linkTo("fields")}>
          <Icon name="back" /> {t("fields.title")}
        </a>
        <h1>{t(field === null ? "fields.new" : "fields.edit")}</h1>
        <TextField
          label={t("fields.name")}
          value={name}
          onChange={(event) => setName(event.target.value)}
          maxLength={120}
          error={error?.faults.find((fault) => fault.path === "name")?.text}
        />
        <RingList
          outline={outline}
          chosen={ringName}
          faults={error?.faults ?? []}
          choose={choose}
          add={() => {
            choose(`exclusions.${outline.exclusions.length}`);
            change((present) => ({ ...present, exclusions: [...present.exclusions, []] }));
          }}
          remove={(removed) => {
            choose("boundary");
            change((present) => withRing(present, removed, null));
          }}
        />
        <p className="muted small">{t("fields.map_hint")}</p>
        <div className="actions">
          <Button icon="undo" disabled={history.past.length === 0} onClick={() => step(undo)}>
            {t("editor.undo")}
          </Button>
          <Button icon="redo" disabled={history.future.length === 0} onClick={() => step(redo)}>
            {t("editor.redo")}
          </Button>
          <Button icon="add" onClick={() => add(nextCorner(ring, start()))}>
            {t("fields.add_corner")}
          </Button>
        </div>
        {selected !== null && ring[selected] && (
          <CornerForm
            index={selected}
            corner={ring[selected]}
            move={(corner) => move(selected, corner)}
            remove={() => remove(selected)}
          />
        )}
        <p>{t("fields.area", { area: units.area(fieldArea_m2(outline)) })}</p>
        {error && (
          <Notice kind="error">
            <p>{error.faults.length > 0 ? t("editor.faults") : describeError(error, t)}</p>
            <ul>
              {otherFaults.map((fault) => (
                <li key={fault.path + fault.text}>{fault.text}</li>
              ))}
            </ul>
          </Notice>
        )}
        <div className="actions">
          <Button kind="primary" isBusy={isBusy} disabled={!isComplete(outline)} onClick={save}>
            {t("fields.save")}
          </Button>
          {field !== null && <DeleteButton field={field} />}
        </div>
      </section>
    </div>
  );
}

/** Deletes a field after a question; plans that were made of it stay. */
function DeleteButton({ field }: { field: StoredField }) {
  const { t } = useTranslation();
  const isOperator = useIsOperator();
  const [isAsking, setAsking] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);
  if (!isOperator) return null;
  const remove = () => {
    deleteField(field.id)
      .then(() => go("fields"))
      .catch((reason: unknown) => setError(asRequestError(reason)));
  };
  return (
    <>
      <Button kind="danger" icon="remove" onClick={() => setAsking(true)}>
        {t("action.delete")}
      </Button>
      {isAsking && (
        <Dialog title={t("fields.delete_title")} close={() => setAsking(false)} kind="danger">
          <p>{t("fields.delete_text", { name: field.name ?? t("fields.unnamed", { id: field.id }) })}</p>
          {error && <ErrorNotice error={error} />}
          <footer className="dialog-actions">
            <Button onClick={() => setAsking(false)}>{t("action.cancel")}</Button>
            <Button kind="danger" icon="remove" onClick={remove}>
              {t("action.delete")}
            </Button>
          </footer>
        </Dialog>
      )}
    </>
  );
}
