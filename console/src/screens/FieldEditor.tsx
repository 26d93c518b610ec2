import { Suspense, useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import { RequestError, type Tagged } from "../api/client";
import { createField, deleteField, getField, listFields, replaceField } from "../api/resources";
import type { StoredField } from "../api/types";
import { useUnits } from "../app/preferences";
import { go, linkTo, setGuard } from "../app/route";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { Dialog } from "../controls/Dialog";
import { TextField } from "../controls/fields";
import { Icon } from "../controls/Icon";
import { ErrorNotice, Notice, Unloaded } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { useLive } from "../live/use_live";
import { asRequestError, useResource } from "../live/use_resource";
import { farmExtent } from "../map/farm_extent";
import { collection, fieldFeatures } from "../map/features";
import { FarmMap } from "../map/map_part";
import { fieldChanges, isSame, isSameField } from "../planning/changes";
import {
  draftOf, EMPTY, fieldArea_m2, isComplete, nextCorner, outlineOf, presentRing, ringOf, ringOfFault,
  withEntry, withRing, type Corner, type Outline, type RingName,
} from "../planning/outline";
import { Attempts, save as saveOver } from "../planning/saving";
import { ConflictNotice } from "./ConflictNotice";
import { CornerForm } from "./CornerForm";
import { EntryForm } from "./EntryForm";
import { RestoredNotice, StepButtons } from "./EditingState";
import { LeaveWarning } from "./LeaveWarning";
import { RingList } from "./RingList";
import { useEntrySymbol } from "./use_corner_symbols";
import { useCorners } from "./use_corners";
import { useEditing } from "./use_editing";
import { useFleetSymbols } from "./use_fleet_symbols";
import { useSaving } from "./use_saving";

const DEFAULT_START: Corner = [40.4434, -3.7382];
const nothing = () => undefined;

interface FieldForm {
  name: string;
  outline: Outline;
}

function formOf(field: StoredField | null): FieldForm {
  return field === null ? { name: "", outline: EMPTY } : { name: field.name ?? "", outline: outlineOf(field) };
}

function isFieldForm(kept: object): boolean {
  return "name" in kept && "outline" in kept && typeof kept.outline === "object";
}

/** A new field, or one that is stored. */
export default function FieldEditor({ id }: { id: number | null }) {
  const { t } = useTranslation();
  const fields = useResource(listFields);
  const read = useResource(() => (id === null ? Promise.resolve(null) : getField(id)));
  const error = fields.error ?? read.error;
  if (fields.value === null || (id !== null && read.value === null)) {
    const reload = () => [fields, read].forEach((one) => one.reload());
    return <Unloaded title={t("fields.title")} error={error} retry={reload} />;
  }
  return <Editor read={read.value} others={fields.value.filter((one) => one.id !== id)} />;
}

function Editor({ read, others }: { read: Tagged<StoredField> | null; others: StoredField[] }) {
  const { t } = useTranslation();
  const units = useUnits();
  const vehicles = useLive((state) => state.vehicles);
  const [chosenRing, setChosenRing] = useState<RingName>("boundary");
  const saving = useSaving<StoredField>();
  const { error, conflict, isBusy } = saving;
  const [attempts] = useState(() => new Attempts());
  const editing = useEditing<FieldForm, StoredField>({
    name: `fields/${read?.value.id ?? "new"}`,
    read,
    stateOf: formOf,
    isState: isFieldForm,
    isLocked: isBusy,
    stepped: () => {
      corners.select(null);
      saving.forget();
    },
  });
  const field = read?.value ?? null;
  const { name, outline } = editing.present;
  const ringName = presentRing(outline, chosenRing);
  const ring = ringOf(outline, ringName);

  const change = (update: (present: Outline) => Outline, continued?: string) => {
    editing.change((present) => ({ ...present, outline: update(present.outline) }), continued);
    if (error !== null) saving.forget();
  };
  const corners = useCorners({
    name: ringName,
    ring,
    change: (update, movement) =>
      change((present) => withRing(present, ringName, update(ringOf(present, ringName))), movement),
  });
  const { selected, add } = corners;
  const choose = (chosen: RingName) => {
    setChosenRing(chosen);
    corners.select(null);
  };
  const stored = () => {
    editing.forget();
    setGuard(null);
    go("fields");
  };
  const save = () => {
    const draft = draftOf(name, outline);
    const base = editing.base;
    const work = () =>
      base === null
        ? attempts.run(draft, draft, createField)
        : saveOver(base, {
            put: (tag) => replaceField(base.value.id, draft, tag),
            read: () => getField(base.value.id),
            isSame: isSameField,
            isMine: (theirs) => isSame(formOf(theirs), { name: name.trim(), outline }),
          });
    saving.run(work, stored, (refusal) => {
      const first = refusal.faults.map((fault) => ringOfFault(fault.path)).find((one) => one !== null);
      if (first) choose(first);
    });
  };
  const copy = () => {
    const shown = name.trim() || t("fields.unnamed", { id: field?.id });
    const draft = draftOf(t("conflict.copy_of", { name: shown }), outline);
    saving.run(() => attempts.run(draft, draft, createField), stored);
  };

  const fleet = useFleetSymbols(others, null, nothing);
  const entry = useEntrySymbol(outline.entry, (place, continued) =>
    change((present) => withEntry(present, place), continued),
  );
  const symbols = useMemo(() => [...fleet, ...corners.symbols, ...entry], [fleet, corners.symbols, entry]);
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
    (fault) => ringOfFault(fault.path) === null && !/^(name|entry)\b/.test(fault.path),
  );

  return (
    <div className="split" inert={isBusy}>
      <LeaveWarning isChanged={editing.isChanged} discard={editing.forget} />
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
        <RestoredNotice editing={editing} />
        {conflict && (
          <ConflictNotice
            kind="field"
            changes={conflict.theirs && editing.base && fieldChanges(editing.base.value, conflict.theirs.value)}
            last={conflict.last}
            isBusy={isBusy}
            load={() => {
              if (conflict.theirs) editing.rebase(conflict.theirs);
              saving.forget();
            }}
            copy={copy}
          />
        )}
        <TextField
          label={t("fields.name")}
          value={name}
          onChange={(event) => {
            const typed = event.target.value;
            editing.change((present) => ({ ...present, name: typed }), "name");
          }}
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
          <StepButtons editing={editing} />
          <Button icon="add" onClick={() => add(nextCorner(ring, start()))}>
            {t("fields.add_corner")}
          </Button>
        </div>
        {selected !== null && ring[selected] && (
          <CornerForm
            title={t("fields.corner", { number: selected + 1 })}
            corner={ring[selected]}
            move={(corner) => corners.move(selected, corner)}
            remove={() => corners.remove(selected)}
            removeText={t("fields.remove_corner")}
          />
        )}
        <EntryForm
          outline={outline}
          fault={error?.faults.find((fault) => fault.path.startsWith("entry"))?.text}
          set={(entry) => change((present) => withEntry(present, entry), "entry")}
        />
        <p>{t("fields.area", { area: units.area(fieldArea_m2(outline)) })}</p>
        {error && (
          <Notice kind="error">
            <p>{error.faults.length > 0 ? t(otherFaults.length > 0 ? "editor.faults" : "editor.faults_marked") : describeError(error, t)}</p>
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
          {editing.base && <DeleteButton field={editing.base} deleted={stored} />}
        </div>
      </section>
    </div>
  );
}

/** Deletes a field after a question; plans that were made of it stay. */
function DeleteButton({ field: { value: field, tag }, deleted }: {
  /** As it is shown: no other version is deleted. */
  field: Tagged<StoredField>;
  deleted: () => void;
}) {
  const { t } = useTranslation();
  const isOperator = useIsOperator();
  const [isAsking, setAsking] = useState(false);
  const [error, setError] = useState<RequestError | null>(null);
  if (!isOperator) return null;
  const remove = () => {
    deleteField(field.id, tag)
      .then(deleted)
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
          <div className="dialog-actions">
            <Button onClick={() => setAsking(false)}>{t("action.cancel")}</Button>
            <Button kind="danger" icon="remove" onClick={remove}>
              {t("action.delete")}
            </Button>
          </div>
        </Dialog>
      )}
    </>
  );
}
