import { Suspense, useEffect, useMemo, useRef, useState } from "react";
import { flushSync } from "react-dom";
import { useTranslation } from "react-i18next";
import type { Fault, Tagged } from "../api/client";
import { createPlan, dispatchPlan, getTaggedPlan, listFields, replacePlan } from "../api/resources";
import type { Command, Plan, PlanDocument, StoredField } from "../api/types";
import { useUnits } from "../app/preferences";
import { go, linkTo, setGuard } from "../app/route";
import { useIsOperator } from "../app/session_context";
import { Button } from "../controls/Button";
import { Segments, SelectField, TextField } from "../controls/fields";
import { Icon } from "../controls/Icon";
import { QuantityField } from "../controls/QuantityField";
import { Notice, Unloaded } from "../controls/states";
import { describeError } from "../i18n/describe_error";
import { useLive } from "../live/use_live";
import { useResource } from "../live/use_resource";
import { extentOf } from "../map/extent";
import { collection, fieldFeatures, placeOf, routeFeatures } from "../map/features";
import { FarmMap } from "../map/map_part";
import { isSamePlan, planChanges } from "../planning/changes";
import {
  COMMAND_TYPES, hasPlace, newCommand, placeOfFault, renumbered, rounded,
} from "../planning/command_forms";
import { HOME, TAKEOFF, WAYPOINT } from "../planning/command_types";
import { documentOf, newMissionId, renumberedFrom } from "../planning/plan_document";
import {
  changedMission, draftName, formOf, isPlanForm, isSameForm, lacksOf, newMission, openAfter, withForm, withMission, type MissionForm, type PlanForm,
} from "../planning/plan_form";
import { Attempts, save as saveOver } from "../planning/saving";
import { orderedSpeed } from "../planning/speed_limits";
import { speedRange } from "../units/limits";
import { CommandForm } from "./CommandForm";
import { ConflictNotice } from "./ConflictNotice";
import { DispatchDialog } from "./DispatchDialog";
import { RestoredNotice, StepButtons } from "./EditingState";
import { HeightProfile } from "./HeightProfile";
import { KeptDraft } from "./KeptDraft";
import { LeaveWarning } from "./LeaveWarning";
import { useEditing } from "./use_editing";
import { useFleetSymbols } from "./use_fleet_symbols";
import { usePlanFence } from "./use_plan_fence";
import { useSaving } from "./use_saving";
import { useStepSymbols } from "./use_step_symbols";

const GONE = 404;
const NO_FIELDS: StoredField[] = [];
const NO_FAULTS: Fault[] = [];
/** Fields of the editor beside those of the steps, as the edge server's faults name them. */
const FIELDS = ["name", "vehicle_id", "maximum_speed"] as const;
type Field = (typeof FIELDS)[number];

/** The field that a fault's path names while one of the missions is edited. */
function fieldOfFault(path: string, mission: number): Field | null {
  return FIELDS.find((name) => path === name || path === `missions.${mission}.${name}`) ?? null;
}

/** The mission that a fault's path names, counted from 0. */
function missionOfFault(path: string): number | null {
  const found = /^missions\.(\d+)\b/.exec(path);
  return found === null ? null : Number(found[1]);
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
      <Unloaded title={t("editor.title_edit")} error={plan.error} retry={plan.reload}>
        {plan.error?.status === GONE && <KeptDraft id={Number(reference)} />}
      </Unloaded>
    );
  }
  const { id, missions } = plan.value.value;
  const isOpen = missions.every((one) => ["held", "queued"].includes(one.dispatch_state));
  if (!isOpen) {
    return (
      <div className="screen">
        <h1 className="visually-hidden">{t("editor.title_edit")}</h1>
        <Notice kind="info">{t("editor.not_editable")}</Notice>
        <KeptDraft id={id} />
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
  const [chosenMission, setMission] = useState(0);
  const adding = useRef<HTMLDivElement>(null);
  const [flown, setFlown] = useState<Tagged<Plan> | null>(null);
  const saving = useSaving<Plan>();
  const { error, conflict, isBusy } = saving;
  const [attempts] = useState(() => new Attempts());
  const editing = useEditing<PlanForm, Plan>({
    name: draftName(read?.value.id ?? "new"),
    read,
    stateOf: formOf,
    isState: isPlanForm,
    isLocked: isBusy,
    stepped: (before, after) => {
      // A step back is seen where it is
      setMission((present) => changedMission(before, after) ?? present);
      setOpen((present) => openAfter(before, after, chosenMission, present));
      saving.forget();
    },
  });
  const plan = read?.value ?? null;
  const form = editing.present;
  // A step back may have removed the mission that was edited
  const missionIndex = Math.min(chosenMission, form.missions.length - 1);
  const mission = form.missions[missionIndex] ?? newMission(null);
  const commands = mission.commands;
  const firstVehicle = [...vehicles.keys()][0] ?? 1;
  const vehicleOf = ({ vehicleId }: MissionForm) => vehicleId ?? firstVehicle;

  const changeForm = (update: (present: PlanForm) => PlanForm, continued?: string) => {
    editing.change(update, continued);
    if (error !== null) saving.forget();
  };
  const changeMission = (part: Partial<MissionForm>, continued?: string) =>
    changeForm(
      (present) => withMission(present, missionIndex, (one) => ({ ...one, ...part })),
      continued && `${continued} ${missionIndex}`,
    );
  const change = (update: (present: Command[]) => Command[], continued?: string) =>
    changeForm((present) => withMission(present, missionIndex, (one) => (
      { ...one, commands: renumbered(update(one.commands)) }
    )), continued);
  const editMission = (index: number) => {
    setMission(index);
    setOpen(null);
  };
  const used = new Set(form.missions.map(vehicleOf));
  const free = [...vehicles.keys()].find((id) => !used.has(id)) ?? null;
  const addMission = () => {
    changeForm((present) => ({ ...present, missions: [...present.missions, newMission(free)] }));
    editMission(form.missions.length);
  };
  const removeMission = () => {
    // The button that was pressed goes; the one beside it takes the focus once there is a drone to add
    flushSync(() => {
      changeForm((present) => (
        { ...present, missions: present.missions.filter((_, index) => index !== missionIndex) }
      ));
      editMission(Math.max(0, missionIndex - 1));
    });
    adding.current?.querySelector("button")?.focus();
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
  /** What is open stays open, wherever it goes. */
  const swapOpen = (index: number, other: number) => {
    swap(index, other);
    setOpen((present) => (present === index ? other : present === other ? index : present));
  };

  const remove = (index: number) => {
    setOpen(null);
    change((present) => present.filter((_, at) => at !== index));
  };

  const lacks = form.missions.flatMap((one) => lacksOf(one).map((name) => ({ name, id: vehicleOf(one) })));
  const draft = (): PlanDocument =>
    withForm(editing.base === null ? null : documentOf(editing.base.value), {
      form: { ...form, name: form.name.trim() || t("editor.title_new") },
      vehicleId: firstVehicle,
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
    const missions = form.missions.map((one) => ({ ...one, vehicleId: vehicleOf(one) }));
    const mine = { name: document.name ?? "", missions };
    const work = () =>
      base === null
        ? attempts.run(form, document, createPlan)
        : saveOver(base, {
            put: (tag) => replacePlan(base.value.id, document, tag),
            read: () => getTaggedPlan(String(base.value.id)),
            isSame: isSamePlan,
            isMine: (theirs) => isSameForm(formOf(theirs), mine),
          });
    saving.run(work, then, (refusal) => {
      const faulty = refusal.faults.map((fault) => missionOfFault(fault.path)).find((one) => one !== null);
      if (faulty !== undefined && faulty !== null) setMission(faulty);
      const first = refusal.faults.map((fault) => placeOfFault(fault.path)).find((one) => one !== null);
      if (first && first.mission === faulty) setOpen(first.index);
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
    const named = { ...document, name: t("conflict.copy_of", { name: document.name }) };
    saving.run(() => attempts.run(["copy", form], named, createPlan), show);
  };

  const faults = error?.faults ?? NO_FAULTS;
  const stepFaults = useMemo(
    () => faults.filter((fault) => placeOfFault(fault.path)?.mission === missionIndex),
    [faults, missionIndex],
  );
  const faultsOf = (index: number) => stepFaults.filter((fault) => placeOfFault(fault.path)?.index === index);
  const faultAt = (name: Field) => faults.find((fault) => fieldOfFault(fault.path, missionIndex) === name)?.text;
  const otherFaults = faults.filter(
    (fault) => !stepFaults.includes(fault) && fieldOfFault(fault.path, missionIndex) === null
      && (missionOfFault(fault.path) ?? missionIndex) === missionIndex,
  );
  const steps = useStepSymbols(commands, open, stepFaults, { select: setOpen, remove, move });

  // Saving keeps that of the plan that is edited
  const fence = usePlanFence(editing.base?.value.geofence);
  const layers = useMemo(
    () => ({
      fields: fieldFeatures(fields.value ?? []),
      fences: fence.features,
      routes: collection(form.missions.flatMap((one) => routeFeatures(one.commands, null))),
    }),
    [fields.value, fence, form.missions],
  );
  const fleet = useFleetSymbols(fields.value ?? NO_FIELDS, null, null);
  const symbols = useMemo(() => [...fleet, ...steps], [fleet, steps]);
  const extent = useMemo(() => {
    const corners = (fields.value ?? []).flatMap((one) =>
      one.boundary.map(([latitude = 0, longitude = 0]) => [longitude, latitude] as const),
    );
    const places = form.missions.flatMap((one) => one.commands).map(placeOf).filter((place) => place !== null);
    return fields.value === null ? null : extentOf([...corners, ...fence.places, ...places]);
  }, [fields.value, fence, form.missions]);
  const middle = useMiddle(commands, fields.value?.[0]?.boundary[0] ?? null);

  return (
    <div className="split" inert={isBusy}>
      <LeaveWarning isChanged={editing.isChanged} discard={editing.forget} />
      <div className="split-map">
        <Suspense fallback={<div className="farm-map" />}>
          <FarmMap
            layers={layers}
            symbols={symbols}
            extent={extent}
            legend={fence.legend}
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
            <p>{error.faults.length > 0 ? t(otherFaults.length > 0 ? "editor.faults" : "editor.faults_marked") : describeError(error, t)}</p>
            <ul>
              {otherFaults.map((fault) => (
                <li key={fault.path + fault.text}>{fault.text}</li>
              ))}
            </ul>
          </Notice>
        )}
        <TextField label={t("editor.name")} value={form.name} onChange={(event) => {
            const name = event.target.value;
            changeForm((present) => ({ ...present, name }), "name");
          }} maxLength={120} error={faultAt("name")} />
        {form.missions.length > 1 && (
          <Segments
            label={t("editor.missions")}
            options={form.missions.map((one, index) => [
              String(index),
              t("vehicle.name", { id: vehicleOf(one) }) + (faults.some((fault) => missionOfFault(fault.path) === index) ? " ⚠" : ""),
            ])}
            value={String(missionIndex)}
            choose={(index) => editMission(Number(index))}
          />
        )}
        <div className="form-line">
          <SelectField label={t("editor.vehicle")} value={vehicleOf(mission)} error={faultAt("vehicle_id")} onChange={(event) => changeMission({ vehicleId: Number(event.target.value) })}>
            {[...new Set([vehicleOf(mission), ...vehicles.keys()])].map((id) => (
              <option key={id} value={id}>
                {t("vehicle.name", { id })}
              </option>
            ))}
          </SelectField>
          <QuantityField
            label={t("editor.speed")}
            unit={units.speedInput}
            value={mission.speed === "" ? null : Number(mission.speed)}
            change={(speed_m_s) => changeMission({ speed: speed_m_s === null ? "" : String(speed_m_s) }, "speed")}
            hint={t("editor.out_of_range", { range: speedRange(units, t) })}
            error={faultAt("maximum_speed") ?? (orderedSpeed(Number(mission.speed)) === null ? t("editor.out_of_range", { range: speedRange(units, t) }) : undefined)}
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
              key={`${missionIndex} ${index}`}
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
              up={() => swapOpen(index, index - 1)}
              down={() => swapOpen(index, index + 1)}
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
        <div className="actions" ref={adding}>
          <Button icon="add" disabled={free === null} onClick={addMission}>{t("editor.add_drone")}</Button>
          {form.missions.length > 1 && (
            <Button icon="remove" onClick={removeMission}>{t("editor.remove_drone", { id: vehicleOf(mission) })}</Button>
          )}
        </div>
        <div className="actions">
          <Button kind="primary" isBusy={isBusy} disabled={lacks.length > 0} onClick={() => save(show)}>
            {t("editor.save")}
          </Button>
          {isOperator && (
            <Button icon="flight" isBusy={isBusy} disabled={lacks.length > 0} onClick={saveAndFly}>
              {t("editor.save_and_fly")}
            </Button>
          )}
        </div>
        {lacks.length > 0 && commands.length > 0 && (
          <ul className="muted small" role="status">
            {lacks.map(({ name, id }) => <li key={`${name} ${id}`}>{t(`editor.lacks_${name}`, { id })}</li>)}
          </ul>
        )}
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
