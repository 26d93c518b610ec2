import { Suspense, useEffect, useMemo, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import type { Fault, Tagged } from "../api/client";
import { createPlan, dispatchPlan, getTaggedPlan, listFields, replacePlan } from "../api/resources";
import type { Command, Plan, PlanDocument } from "../api/types";
import { useUnits } from "../app/preferences";
import { go, linkTo, setGuard } from "../app/route";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { SelectField, TextField } from "../controls/fields";
import { Icon } from "../controls/Icon";
import { QuantityField } from "../controls/QuantityField";
import { ErrorNotice, Notice, Skeleton } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { useLive } from "../live/use_live";
import { useResource } from "../live/use_resource";
import { extentOf } from "../map/extent";
import { collection, fieldFeatures, placeOf, routeFeatures } from "../map/features";
import { FarmMap } from "../map/map_part";
import { isSamePlan, planChanges } from "../planning/changes";
import {
  COMMAND_TYPES, hasPlace, HOME, newCommand, placeOfFault, problemsOf, renumbered,
  rounded, TAKEOFF, WAYPOINT,
} from "../planning/command_forms";
import { documentOf, newMissionId, renumberedFrom } from "../planning/plan_document";
import { formOf, isSameForm, withForm, type PlanForm } from "../planning/plan_form";
import { save as saveOver } from "../planning/saving";
import { CommandForm } from "./CommandForm";
import { ConflictNotice } from "./ConflictNotice";
import { DispatchDialog } from "./DispatchDialog";
import { RestoredNotice, StepButtons } from "./EditingState";
import { HeightProfile } from "./HeightProfile";
import { LeaveWarning } from "./LeaveWarning";
import { useEditing } from "./use_editing";
import { fieldNames } from "./use_fleet_symbols";
import { useSaving } from "./use_saving";
import { useStepSymbols } from "./use_step_symbols";

const NO_FAULTS: Fault[] = [];
/** Fields of the editor beside those of the steps, as the edge server's faults name them. */
const FIELDS = ["name", "vehicle_id", "maximum_speed"] as const;

function fieldOfFault(path: string): (typeof FIELDS)[number] | null {
  return FIELDS.find((name) => path === name || path === `missions.0.${name}`) ?? null;
}

/** A new plan, or one that no vehicle has yet. */
export default function PlanEditor({ reference }: { reference: string | null }) {
  const { t } = useTranslation();
  const plan = useResource(
    () => (reference === null ? Promise.resolve(null) : getTaggedPlan(reference)),
    reference ?? "",
  );
  if (reference === null) return <Editor read={null} />;
  if (plan.value === null) {
    return (
      <div className="screen">
        {plan.error ? <ErrorNotice error={plan.error} retry={plan.reload} /> : <Skeleton />}
      </div>
    );
  }
  const { id, missions } = plan.value.value;
  const isOpen = missions.every((one) => ["held", "queued"].includes(one.dispatch_state));
  const problem = missions.length > 1 ? "several" : isOpen ? null : "not_editable";
  if (problem !== null) {
    return (
      <div className="screen">
        <Notice kind="info">{t(`editor.${problem}`)}</Notice>
        <a className="back-link" {...linkTo(`plans/${id}`)}>
          <Icon name="back" /> {t("action.back")}
        </a>
      </div>
    );
  }
  return <Editor read={plan.value} />;
}

function Editor({ read }: { read: Tagged<Plan> | null }) {
  const { t } = useTranslation();
  const units = useUnits();
  const isOperator = useIsOperator();
  const vehicles = useLive((state) => state.vehicles);
  const fields = useResource(listFields);
  const dragged = useRef<number | null>(null);
  const drags = useRef(0);
  const [open, setOpen] = useState<number | null>(null);
  const [flown, setFlown] = useState<Tagged<Plan> | null>(null);
  const saving = useSaving<Plan>();
  const { error, conflict, isBusy } = saving;
  const editing = useEditing<PlanForm, Plan>({
    name: `plans/${read?.value.id ?? "new"}`,
    read,
    stateOf: formOf,
    stepped: () => {
      setOpen(null);
      saving.forget();
    },
  });
  const plan = read?.value ?? null;
  const form = editing.present;
  const commands = form.commands;
  const chosen = form.vehicleId ?? [...vehicles.keys()][0] ?? 1;

  const changeForm = (part: Partial<PlanForm>, continued?: string) => {
    editing.change((present) => ({ ...present, ...part }), continued);
    if (error !== null) saving.forget();
  };
  const change = (update: (present: Command[]) => Command[], continued?: string) => {
    editing.change((present) => ({ ...present, commands: renumbered(update(present.commands)) }), continued);
    if (error !== null) saving.forget();
  };
  const add = (type: number, place: { latitude: number; longitude: number }) => {
    // A flight begins with a takeoff and, until somebody decides otherwise, ends at home
    change((present) => {
      if (present.length === 0 && type === WAYPOINT) {
        return [newCommand(TAKEOFF, 1, place), newCommand(HOME, 2, place)];
      }
      const made = newCommand(type, present.length + 1, place);
      const last = present.at(-1);
      return last?.command_type_id === HOME
        ? [...present.slice(0, -1), made, last]
        : [...present, made];
    });
  };
  const move = (index: number, latitude: number, longitude: number, isDropped: boolean) => {
    drags.current += dragged.current === index ? 0 : 1;
    dragged.current = isDropped ? null : index;
    change((present) =>
      present.map((one, at) =>
        at === index
          ? { ...one, parameters: { ...one.parameters, latitude: rounded(latitude), longitude: rounded(longitude) } }
          : one,
      ),
      `drag ${drags.current}`,
    );
  };
  const swap = (index: number, other: number) =>
    change((present) => {
      const moved = [...present];
      const [one, two] = [present[index], present[other]];
      if (one && two) [moved[index], moved[other]] = [two, one];
      return moved;
    });

  const remove = (index: number) => {
    setOpen(null);
    change((present) => present.filter((_, at) => at !== index));
  };

  const hasProblem = !(Number(form.speed) > 0) || commands.some((command) => problemsOf(command).length > 0);
  const draft = (): PlanDocument =>
    withForm(editing.base === null ? null : documentOf(editing.base.value), {
      form: { ...form, name: form.name.trim() || t("editor.title_new") },
      vehicleId: chosen,
      missionId: newMissionId(Date.now()),
    });
  const forgetDraft = () => {
    editing.forget();
    setGuard(null);
  };
  const show = ({ id }: Plan) => {
    forgetDraft();
    go(`plans/${id}`);
  };
  const save = (then: (stored: Plan) => void | Promise<void>) => {
    const document = draft();
    const base = editing.base;
    const work = () =>
      base === null
        ? createPlan(document)
        : saveOver(base, {
            put: (tag) => replacePlan(base.value.id, document, tag),
            read: () => getTaggedPlan(String(base.value.id)),
            isSame: isSamePlan,
            isMine: (theirs) => isSameForm(formOf(theirs), { ...form, vehicleId: chosen }),
          });
    saving.run(work, then, (refusal) => {
      const first = refusal.faults.map((fault) => placeOfFault(fault.path)).find((one) => one !== null);
      if (first) setOpen(first.index);
    });
  };
  /** Nothing flies by one click: the stored plan is dispatched as from its own page. */
  const saveAndFly = () =>
    save(({ id }) => {
      forgetDraft();
      return getTaggedPlan(String(id)).then(setFlown, () => go(`plans/${id}`));
    });
  const copy = () => {
    const document = renumberedFrom(draft(), newMissionId(Date.now()));
    saving.run(() => createPlan({ ...document, name: t("conflict.copy_of", { name: document.name }) }), show);
  };

  const faultsOf = (index: number) =>
    (error?.faults ?? []).filter((fault) => placeOfFault(fault.path)?.index === index);
  const faultAt = (name: (typeof FIELDS)[number]) => error?.faults.find((fault) => fieldOfFault(fault.path) === name)?.text;
  const otherFaults = (error?.faults ?? []).filter(
    (fault) => placeOfFault(fault.path) === null && fieldOfFault(fault.path) === null,
  );
  const steps = useStepSymbols(commands, open, error?.faults ?? NO_FAULTS, { select: setOpen, remove, move });

  const layers = useMemo(
    () => ({
      fields: fieldFeatures(fields.value ?? []),
      routes: collection(routeFeatures(commands, null)),
    }),
    [fields.value, commands],
  );
  const symbols = useMemo(
    () => [
      ...fieldNames(fields.value ?? []),
      ...steps,
    ],
    [fields.value, steps],
  );
  const extent = useMemo(() => {
    const corners = (fields.value ?? []).flatMap((one) =>
      one.boundary.map(([latitude = 0, longitude = 0]) => [longitude, latitude] as const),
    );
    const places = commands.map(placeOf).filter((place) => place !== null);
    return fields.value === null ? null : extentOf([...corners, ...places]);
  }, [fields.value, commands]);
  const middle = useMiddle(commands, fields.value?.[0]?.boundary[0] ?? null);

  return (
    <div className="split">
      <LeaveWarning isChanged={editing.isChanged} discard={editing.forget} />
      <div className="split-map">
        <Suspense fallback={<div className="farm-map" />}>
          <FarmMap
            layers={layers}
            symbols={symbols}
            extent={extent}
            label={t("map.label")}
            click={(longitude, latitude) => add(WAYPOINT, { latitude, longitude })}
          />
        </Suspense>
        {commands.length === 0 && <p className="map-hint">{t("editor.empty")}</p>}
      </div>
      <section className="split-side">
        <a className="back-link" {...linkTo(plan === null ? "plans" : `plans/${plan.id}`)}>
          <Icon name="back" /> {t("action.back")}
        </a>
        <h1>{t(plan === null ? "editor.title_new" : "editor.title_edit")}</h1>
        <RestoredNotice editing={editing} />
        {conflict && (
          <ConflictNotice
            kind="plan"
            changes={conflict.theirs && editing.base && planChanges(editing.base.value, conflict.theirs.value)}
            last={conflict.last}
            isBusy={isBusy}
            load={() => {
              if (conflict.theirs) editing.rebase(conflict.theirs);
              saving.forget();
            }}
            copy={copy}
          />
        )}
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
        <TextField label={t("editor.name")} value={form.name} onChange={(event) => changeForm({ name: event.target.value }, "name")} maxLength={120} error={faultAt("name")} />
        <div className="form-line">
          <SelectField label={t("editor.vehicle")} value={chosen} error={faultAt("vehicle_id")} onChange={(event) => changeForm({ vehicleId: Number(event.target.value) })}>
            {[...new Set([chosen, ...vehicles.keys()])].map((id) => (
              <option key={id} value={id}>
                {t("vehicle.name", { id })}
              </option>
            ))}
          </SelectField>
          <QuantityField
            label={t("editor.speed")}
            unit={units.speedInput}
            value={form.speed === "" ? null : Number(form.speed)}
            change={(speed_m_s) => changeForm({ speed: speed_m_s === null ? "" : String(speed_m_s) }, "speed")}
            error={faultAt("maximum_speed")}
          />
        </div>
        <div className="actions">
          <StepButtons editing={editing} />
        </div>
        <HeightProfile commands={commands} open={open} />
        {commands.length > 0 && <p className="muted small">{t("editor.map_hint")}</p>}
        <ol className="steps">
          {commands.map((command, index) => (
            <CommandForm
              key={index}
              index={index}
              count={commands.length}
              command={command}
              isOpen={open === index}
              faults={faultsOf(index)}
              toggle={() => setOpen(open === index ? null : index)}
              change={(parameters) =>
                change((present) => present.map((one, at) => (at === index ? { ...one, parameters } : one)))
              }
              remove={() => remove(index)}
              up={() => swap(index, index - 1)}
              down={() => swap(index, index + 1)}
            />
          ))}
        </ol>
        <SelectField label={t("editor.add")} value="" onChange={(event) => add(Number(event.target.value), middle)}>
          <option value="" disabled>
            …
          </option>
          {COMMAND_TYPES.map((type) => (
            <option key={type} value={type}>
              {t(`command.${type}`)}
              {hasPlace(type) ? " ⌖" : ""}
            </option>
          ))}
        </SelectField>
        <div className="actions">
          <Button kind="primary" isBusy={isBusy} disabled={commands.length === 0 || hasProblem} onClick={() => save(show)}>
            {t("editor.save")}
          </Button>
          {isOperator && (
            <Button icon="flight" isBusy={isBusy} disabled={commands.length === 0 || hasProblem} onClick={saveAndFly}>
              {t("editor.save_and_fly")}
            </Button>
          )}
        </div>
      </section>
      {flown !== null && <Departure plan={flown} />}
    </div>
  );
}

/** The dialog with which a plan that was just stored is dispatched; then its page is shown. */
function Departure({ plan: { value: plan, tag } }: { plan: Tagged<Plan> }) {
  const dispatching = useSaving<unknown>();
  const leave = () => go(`plans/${plan.id}`);
  return (
    <DispatchDialog
      plan={plan}
      error={dispatching.error}
      isBusy={dispatching.isBusy}
      dispatch={() => dispatching.run(() => dispatchPlan(plan.id, tag), leave)}
      close={leave}
    />
  );
}

/** Where a command is put that was chosen from the list: at the last place, or in the first field. */
function useMiddle(commands: Command[], corner: number[] | null) {
  const [middle, setMiddle] = useState({ latitude: 40.4434, longitude: -3.7382 });
  useEffect(() => {
    const last = commands.map(placeOf).filter((place) => place !== null).at(-1);
    if (last) setMiddle({ latitude: last[1], longitude: last[0] });
    else if (corner) setMiddle({ latitude: corner[0] ?? 0, longitude: corner[1] ?? 0 });
  }, [commands, corner]);
  return middle;
}
