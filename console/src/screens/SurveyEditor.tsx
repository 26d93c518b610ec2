import { Suspense, useCallback, useEffect, useMemo, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { RequestError } from "../api/client";
import { createSurvey, listFields, previewSurvey } from "../api/resources";
import type { PlannedSurvey, StoredField, SurveyOrder } from "../api/types";
import { go, linkTo } from "../app/route";
import { useIsOperator, useSession } from "../app/session_context";
import { Button } from "../controls/Button";
import { Icon } from "../controls/Icon";
import { ErrorNotice, Notice, Skeleton } from "../controls/states";
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
import { cameraOf, FIRST_FORM, inputOfFault, orderOf, textOfFault, type SurveyForm } from "../planning/survey";
import { SurveyDeparture } from "./SurveyDeparture";
import { SurveyFigures } from "./SurveyFigures";
import { SurveyInputs } from "./SurveyInputs";
import { useFleetSymbols } from "./use_fleet_symbols";

const NO_FIELDS: StoredField[] = [];
const nothing = () => undefined;

/** A survey of a field: what a person chooses, its preview on the map, and the plans it becomes. */
export default function SurveyEditor({ fieldId }: { fieldId: number }) {
  const fields = useResource(listFields);
  const field = fields.value?.find((one) => one.id === fieldId) ?? null;
  if (field !== null) return <Editor field={field} />;
  const error = fields.value === null ? fields.error : new RequestError(404, "");
  return (
    <div className="screen">
      {error ? <ErrorNotice error={error} retry={fields.reload} /> : <Skeleton />}
    </div>
  );
}

function Editor({ field }: { field: StoredField }) {
  const { t } = useTranslation();
  const known = useLive((state) => state.vehicles);
  const choices = useChoices(field.id);
  const [opened] = useState<SurveyForm>({ ...FIRST_FORM, ...choices.first?.form });
  const [form, setForm] = useState(opened);
  const [picked, setPicked] = useState<number[] | null>(choices.first?.picked ?? null);
  const { keep } = choices;
  useEffect(() => {
    if (form !== opened || picked !== null) keep({ form, picked });
  }, [keep, form, opened, picked]);
  const vehicles = picked ?? [[...known.keys()][0] ?? 1];
  const order = orderOf(form, field.id, vehicles);
  const preview = usePreview(order, previewSurvey);
  const storing = useStoring();
  const isOperator = useIsOperator();
  const [isDeparting, setDeparting] = useState(false);
  const error = storing.error ?? preview.error;
  const survey = preview.value;

  const flights = useMemo(() => (survey === null ? [] : surveyFlights(survey)), [survey]);
  const chosen = vehicles.join();
  const pictures = useFootprints(form, survey, flights, chosen);
  const layers = useMemo(() => {
    const ids = chosen.split(",").map(Number);
    const lines = flights.length === 0 ? [] : surveyFeatures(flights, ids).features;
    return { fields: fieldFeatures([field]), routes: collection([...pictures, ...lines]) };
  }, [field, flights, pictures, chosen]);
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
    return [...fleet, ...starts, ...entry];
  }, [fleet, flights, field, chosen, t]);
  const extent = useMemo(() => farmExtent([field], []), [field]);

  const change = (part: Partial<SurveyForm>) => {
    setForm((present) => ({ ...present, ...part }));
    storing.forget();
  };
  return (
    <div className="split">
      <div className="split-map is-drawn-on">
        <Suspense fallback={<div className="farm-map" />}>
          <FarmMap layers={layers} symbols={symbols} extent={extent} label={t("map.label")} />
        </Suspense>
      </div>
      <section className="split-side">
        <a className="back-link" {...linkTo("fields")}>
          <Icon name="back" /> {t("fields.title")}
        </a>
        <h1>{t("survey.title", { field: field.name ?? t("fields.unnamed", { id: field.id }) })}</h1>
        <SurveyFigures survey={survey} isLoading={preview.isLoading} />
        {preview.error && <Refusal error={preview.error} form={form} retry={preview.retry} />}
        <SurveyInputs
          form={form}
          vehicles={vehicles}
          flights={flights}
          direction_deg={survey?.angle_deg ?? null}
          faults={error?.faults ?? []}
          change={change}
          pick={(ids) => {
            setPicked(ids);
            storing.forget();
          }}
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
}

/** What the person has chosen for this field before: after a reload nobody enters it again. */
function useChoices(fieldId: number) {
  const { session } = useSession();
  const drafts = useMemo(() => new Drafts(window.localStorage, session.name), [session.name]);
  const name = `surveys/${fieldId}`;
  const [first] = useState(() => drafts.read<Choices, never>(name, (state) => "form" in state)?.state ?? null);
  const keep = useCallback(
    (state: Choices) => drafts.write(name, { at_ms: Date.now(), base: null, state }),
    [drafts, name],
  );
  return { first, keep };
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
