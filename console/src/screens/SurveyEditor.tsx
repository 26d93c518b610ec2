import { Suspense, useEffect, useMemo, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { RequestError } from "../api/client";
import { createSurvey, listFields, previewSurvey } from "../api/resources";
import type { PlannedSurvey, StoredField, SurveyOrder } from "../api/types";
import { go, linkTo } from "../app/route";
import { useIsOperator, useSession } from "../app/session_context";
import { Button } from "../controls/Button";
import { Icon } from "../controls/Icon";
import { ErrorNotice, Notice, Unloaded } from "../controls/states";
import type { Fix } from "../live/motion";
import { useLive } from "../live/use_live";
import { usePreview } from "../live/use_preview";
import { asRequestError, useResource } from "../live/use_resource";
import { farmExtent } from "../map/farm_extent";
import { collection, fieldFeatures } from "../map/features";
import { FarmMap } from "../map/map_part";
import { entryElement, flightElement } from "../map/markers";
import {
  colourOf, footprintFeatures, footprintOf, surveyFeatures, surveyFlights, type SurveyFlight,
} from "../map/survey_features";
import { Drafts } from "../planning/drafts";
import { newKey } from "../planning/saving";
import { begin } from "../planning/history";
import { FEWEST_CORNERS, outlineOf } from "../planning/outline";
import { cameraOf, FIRST_FORM, inputOfFault, orderOf, textOfFault, type Homes, type SurveyForm } from "../planning/survey";
import {
  areaOfKept, areaOfRing, cornerOfFault, keptOf, ringOfArea, type KeptArea, type SurveyArea as Area,
} from "../planning/survey_area";
import { SurveyArea } from "./SurveyArea";
import { SurveyDeparture } from "./SurveyDeparture";
import { SurveyFigures } from "./SurveyFigures";
import { SurveyInputs } from "./SurveyInputs";
import { useCorners } from "./use_corners";
import { useFleetSymbols } from "./use_fleet_symbols";
import { useSteps, type Steps } from "./use_steps";

const NO_FIELDS: StoredField[] = [];
/** About a metre: the map is not drawn anew for the noise of a receiver. */
const PLACE_DIGITS = 5;
const nothing = () => undefined;

/** A survey of a field or a part of it: what a person chooses, its preview on the map, and the plans it becomes. */
export default function SurveyEditor({ fieldId }: { fieldId: number }) {
  const { t } = useTranslation();
  const fields = useResource(listFields);
  const field = fields.value?.find((one) => one.id === fieldId) ?? null;
  if (field !== null) return <Editor field={field} fields={fields.value ?? NO_FIELDS} />;
  const error = fields.value === null ? fields.error : new RequestError(404, "");
  return <Unloaded title={t("fields.survey")} error={error} retry={fields.reload} />;
}

/** Number of a vehicle and where it was last seen standing, as text, which is compared: it is drawn once. */
function homeText(id: number, home: Fix | undefined): string {
  if (home === undefined) return "";
  return [id, home.longitude_deg.toFixed(PLACE_DIGITS), home.latitude_deg.toFixed(PLACE_DIGITS)].join(" ");
}

function homesIn(texts: string): Homes {
  const numbers = texts.split(";").map((text) => text.split(" ").map(Number));
  return new Map(numbers.flatMap(([id, longitude, latitude]) =>
    id === undefined || longitude === undefined || latitude === undefined ? [] : [[id, [longitude, latitude]]]));
}

function Editor({ field, fields }: { field: StoredField; fields: readonly StoredField[] }) {
  const { t } = useTranslation();
  const known = useLive((state) => state.vehicles);
  const storing = useStoring();
  const steps = useChoices(field, () => {
    corners.select(null);
    storing.forget();
  });
  const { form, picked, area } = steps.present;
  const vehicles = picked ?? [[...known.keys()][0] ?? 1];
  const standing = useLive(({ homes }) => vehicles.map((id) => homeText(id, homes.get(id))).join(";"));
  // The edge server knows where a vehicle is, which may fly by now, and not from where it will take off
  const order = orderOf(form, field.id, vehicles, area, homesIn(standing));
  const [isFollowed, setFollowed] = useState(false);
  const preview = usePreview(order, previewSurvey, isFollowed);
  const isOperator = useIsOperator();
  const [isDeparting, setDeparting] = useState(false);
  const error = storing.error ?? preview.error;
  const survey = preview.value;
  const ring = useMemo(() => ringOfArea(area, field), [area, field]);
  const choose = (update: (present: Choices) => Choices, movement?: string) => {
    setFollowed(movement !== undefined);
    steps.change(update, movement);
    storing.forget();
  };
  // The list of all is beside the map, perhaps scrolled away while a corner is dragged
  const areaFault = error?.faults.find(({ path }) => path === "area" || cornerOfFault(path) !== null);
  const corners = useCorners({
    name: "boundary",
    ring,
    faulty: (error?.faults ?? []).map(({ path }) => cornerOfFault(path)).filter((one) => one !== null),
    change: (update, movement) =>
      choose((present) => {
        const changed = update(ringOfArea(present.area, field));
        return changed.length < FEWEST_CORNERS ? present : { ...present, area: areaOfRing(changed, field) };
      }, movement),
  });

  const flights = useMemo(() => (survey === null ? [] : surveyFlights(survey)), [survey]);
  const chosen = vehicles.join();
  const pictures = useFootprints(form, survey, flights, chosen);
  const layers = useMemo(() => {
    const ids = chosen.split(",").map(Number);
    const lines = flights.length === 0 ? [] : surveyFeatures(flights, ids).features;
    const drawn = fieldFeatures([{ boundary: ring }], "drawn").features;
    return { fields: collection([...fieldFeatures([field]).features, ...drawn]), routes: collection([...pictures, ...lines]) };
  }, [field, ring, flights, pictures, chosen]);
  const fleet = useFleetSymbols(NO_FIELDS, null, nothing);
  const symbols = useMemo(() => {
    const ids = chosen.split(",").map(Number);
    const starts = flights.flatMap(({ vehicleId, round, places }) => {
      const [place] = places;
      const colour = colourOf(vehicleId, ids);
      const text = t("survey.flight_start", { id: vehicleId, round });
      return place === undefined
        ? []
        : [{
            key: `flight-${vehicleId}-${round}-${colour}`,
            longitude: place[0],
            latitude: place[1],
            level: 4,
            make: () => flightElement(text, colour),
          }];
    });
    const [latitude, longitude] = field.entry ?? [];
    const entry = latitude === undefined || longitude === undefined
      ? []
      : [{ key: "entry", latitude, longitude, level: 5, make: () => entryElement(t("fields.entry"), null) }];
    return [...fleet, ...starts, ...entry, ...corners.symbols];
  }, [fleet, flights, field, corners.symbols, chosen, t]);
  const extent = useMemo(() => farmExtent([field], []), [field]);

  const change = (part: Partial<SurveyForm>) =>
    choose(
      (present) => ({ ...present, form: { ...present.form, ...part } }),
      typeof part.direction_deg === "number" && typeof form.direction_deg === "number" ? "direction" : undefined,
    );
  return (
    <div className="split">
      <div className="split-map is-drawn-on">
        <Suspense fallback={<div className="farm-map" />}>
          <FarmMap layers={layers} symbols={symbols} extent={extent} label={t("map.label")} />
        </Suspense>
        {areaFault && (
          <p className="map-hint" aria-hidden="true">
            <FaultName path={areaFault.path} /> {areaFault.text}
          </p>
        )}
      </div>
      <section className="split-side">
        <a className="back-link" {...linkTo("fields")}>
          <Icon name="back" /> {t("fields.title")}
        </a>
        <h1>{t("survey.title", { field: field.name ?? t("fields.unnamed", { id: field.id }) })}</h1>
        <SurveyFigures survey={survey} isLoading={preview.isLoading} />
        {preview.error && <Refusal error={preview.error} form={form} retry={preview.retry} />}
        <SurveyArea
          ring={ring}
          field={outlineOf(field)}
          isWhole={area === null}
          corners={corners}
          steps={steps}
          takeWhole={() => {
            corners.select(null);
            choose((present) => ({ ...present, area: null }));
          }}
        />
        <SurveyInputs
          form={form}
          vehicles={vehicles}
          flights={flights}
          direction_deg={survey?.angle_deg ?? null}
          faults={error?.faults ?? []}
          change={change}
          pick={(ids) => choose((present) => ({ ...present, picked: ids }))}
        />
        {order === null && <Notice kind="info">{t("survey.incomplete")}</Notice>}
        {storing.error && <Refusal error={storing.error} form={form} />}
        <p className="muted small">
          {survey !== null && survey.plans.length > 1
            ? t("survey.several", { count: survey.plans.length })
            : t("survey.held")}
        </p>
        <div className="actions">
          <Button
            kind="primary"
            icon="plan"
            isBusy={storing.isBusy}
            disabled={order === null || survey === null || preview.isLoading}
            onClick={() => order && storing.store(order)}
          >
            {t("survey.make")}
          </Button>
          {isOperator && (
            <Button
              icon="flight"
              disabled={order === null || survey === null || preview.isLoading || storing.isBusy}
              onClick={() => setDeparting(true)}
            >
              {t("survey.fly")}
            </Button>
          )}
        </div>
        {isDeparting && order !== null && survey !== null && (
          <SurveyDeparture
            field={field}
            fields={fields}
            survey={survey}
            order={order}
            keyFor={storing.keyFor}
            close={() => setDeparting(false)}
          />
        )}
      </section>
    </div>
  );
}

interface Choices {
  form: SurveyForm;
  picked: number[] | null;
  area: Area;
}

/** As this browser keeps them; those of an older version of the console have no area. */
type KeptChoices = Omit<Choices, "area"> & { area?: KeptArea | null };

/** What the person chooses, beginning with what was chosen before: after a reload nobody enters it again. */
function useChoices(field: StoredField, stepped: () => void): Steps<Choices> {
  const { session } = useSession();
  const drafts = useMemo(() => new Drafts(window.sessionStorage, window.localStorage, session.name), [session.name]);
  const name = `surveys/${field.id}`;
  const [opened] = useState((): Choices => {
    const kept = drafts.read<KeptChoices, never>(name, (state) => "form" in state)?.state;
    return {
      form: { ...FIRST_FORM, ...kept?.form },
      picked: kept?.picked ?? null,
      area: areaOfKept(kept?.area, field),
    };
  });
  const steps = useSteps(() => begin(opened), { stepped });
  const { present } = steps;
  useEffect(() => {
    if (present === opened) return;
    const state: KeptChoices = { ...present, area: keptOf(present.area, field) };
    drafts.write(name, { at_ms: Date.now(), base: null, state });
  }, [drafts, name, field, opened, present]);
  return steps;
}

/** The ground of every picture, as the camera and height of the shown survey give it. */
function useFootprints(
  form: SurveyForm, survey: PlannedSurvey | null, flights: readonly SurveyFlight[], chosen: string,
): GeoJSON.Feature[] {
  const latest = useRef(form);
  latest.current = form;
  return useMemo(() => {
    const { height_m } = latest.current;
    const camera = cameraOf(latest.current);
    if (survey === null || camera === null || height_m === null) return [];
    const footprint = footprintOf(camera, height_m, survey.angle_deg);
    return footprintFeatures(flights, chosen.split(",").map(Number), footprint);
    // A form that has changed counts when its survey is there
  }, [survey, flights, chosen]);
}

/** Why there is no survey; what concerns one input stands there. */
function Refusal({ error, form, retry }: { error: RequestError; form: SurveyForm; retry?: () => void }) {
  const { t } = useTranslation();
  const others = error.faults.filter((fault) => inputOfFault(fault.path, form) === null);
  if (error.faults.length === 0) return <ErrorNotice error={error} {...(retry ? { retry } : {})} />;
  return (
    <Notice kind="error">
      <p>{t("editor.faults")}</p>
      <ul>
        {others.map((fault) => (
          <li key={fault.path + fault.text}>
            <FaultName path={fault.path} /> {fault.text}
          </li>
        ))}
      </ul>
      {others.length < error.faults.length && <p>{t("survey.fault_below")}</p>}
    </Notice>
  );
}

/** What a fault concerns, by the text beside its input where the screen has one. */
function FaultName({ path }: { path: string }) {
  const { t } = useTranslation();
  const corner = cornerOfFault(path);
  if (corner !== null) return <strong>{t("fields.corner", { number: corner + 1 })}:</strong>;
  const text = textOfFault(path);
  if (text !== null) return <strong>{t(text)}:</strong>;
  return path === "" ? null : <code>{path}</code>;
}

/** Stores the plans once, also when the answer to the first attempt was lost, and goes to the first. */
function useStoring() {
  const [error, setError] = useState<RequestError | null>(null);
  const [isBusy, setBusy] = useState(false);
  const keys = useRef(new Map<string, string>());
  const keyFor = (order: SurveyOrder): string => {
    const text = JSON.stringify(order);
    const key = keys.current.get(text) ?? newKey();
    keys.current.set(text, key);
    return key;
  };
  const store = (order: SurveyOrder) => {
    setBusy(true);
    createSurvey(order, keyFor(order))
      .then(({ plans }) => go(`plans/${plans[0]?.id ?? ""}`))
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setBusy(false));
  };
  const forget = () => {
    keys.current.clear();
    setError(null);
  };
  return { error, isBusy, store, forget, keyFor };
}
