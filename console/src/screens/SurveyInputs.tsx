import { useId } from "react";
import { useTranslation } from "react-i18next";
import type { Fault } from "../api/client";
import { useUnits } from "../app/preferences";
import { Segments, SelectField } from "../controls/fields";
import { QuantityField } from "../controls/QuantityField";
import { colourOf, type SurveyFlight } from "../map/survey_features";
import {
  CAMERA_CHOICES, cameraOf, heightOf_m, inputOfFault, resolutionOf_m, type Camera,
  type CameraChoice, type FaultPath, type SurveyForm,
} from "../planning/survey";
import { orderedSpeed } from "../planning/speed_limits";
import { speedRange } from "../units/limits";
import { MINUTES, PERCENT } from "../units/fields";
import { SurveyVehicles } from "./SurveyVehicles";

const MILLIMETRES = { symbol: "mm", factor: 1, digits: 2 };
const PIXELS = { symbol: "px", factor: 1, digits: 0 };
const SIZES = [
  ["sensor_width_mm", MILLIMETRES], ["sensor_height_mm", MILLIMETRES],
  ["focal_length_mm", MILLIMETRES], ["pixels_across", PIXELS],
] as const satisfies [keyof Camera, object][];

/** The choices of a survey; ground resolution and height follow each other. */
export function SurveyInputs({ form, vehicles, flights, direction_deg, faults, change, pick }: {
  form: SurveyForm;
  vehicles: readonly number[];
  flights: readonly SurveyFlight[];
  /** The bearing of the lines that the edge server has found. */
  direction_deg: number | null;
  faults: readonly Fault[];
  change: (part: Partial<SurveyForm>) => void;
  pick: (vehicles: number[]) => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const camera = cameraOf(form);
  const errorOf = (path: FaultPath): string | undefined =>
    path === "maximum_speed" && form.speed_m_s !== null && orderedSpeed(form.speed_m_s) === null
      ? t("editor.out_of_range", { range: speedRange(units, t) })
      : faults.find((fault) => inputOfFault(fault.path, form) === path)?.text;
  /** What is wrong with a value that is null: nothing usable was entered. */
  const faultOfEmpty = (value: number | null) => (value === null ? t("editor.number") : undefined);
  const quantity = (
    name: "height_m" | "swath_width_m" | "side_overlap" | "front_overlap" | "speed_m_s" | "endurance_s",
    unit: typeof PERCENT,
    path: FaultPath,
  ) => (
    <QuantityField
      label={t(`survey.${name}`)}
      unit={unit}
      value={form[name]}
      change={(value) => change({ [name]: value })}
      error={errorOf(path) ?? faultOfEmpty(form[name])}
    />
  );
  return (
    <div className="survey-form">
      <SelectField
        label={t("survey.camera")}
        value={form.camera}
        onChange={(event) => change({ camera: event.target.value as CameraChoice })}
      >
        {CAMERA_CHOICES.map((name) => (
          <option key={name} value={name}>{t(`survey.camera_${name}`)}</option>
        ))}
      </SelectField>
      {form.camera === "own" && (
        <div className="form-grid">
          {SIZES.map(([name, unit]) => (
            <QuantityField
              key={name}
              label={t(`survey.${name}`)}
              unit={unit}
              value={form.own[name]}
              change={(value) => change({ own: { ...form.own, [name]: value } })}
              error={name === "pixels_across" ? faultOfEmpty(form.own[name]) : errorOf(`camera.${name}`) ?? faultOfEmpty(form.own[name])}
            />
          ))}
        </div>
      )}
      <div className="form-grid">
        {form.camera === "none" ? (
          quantity("swath_width_m", units.heightInput, "swath_width")
        ) : (
          <QuantityField
            label={t("survey.resolution")}
            unit={units.resolutionInput}
            value={camera === null || form.height_m === null ? null : resolutionOf_m(camera, form.height_m)}
            change={(value) =>
              camera && change({ height_m: value === null ? null : heightOf_m(camera, value) })
            }
            error={camera === null ? undefined : faultOfEmpty(form.height_m)}
          />
        )}
        {quantity("height_m", units.heightInput, "altitude")}
        {quantity("side_overlap", PERCENT, "side_overlap")}
        {form.camera !== "none" && quantity("front_overlap", PERCENT, "front_overlap")}
        {quantity("speed_m_s", units.speedInput, "maximum_speed")}
        {quantity("endurance_s", MINUTES, "endurance")}
      </div>
      <Direction form={form} found_deg={direction_deg} error={errorOf("angle")} change={change} />
      <SurveyVehicles
        chosen={vehicles}
        flights={flights}
        colour={(id) => colourOf(id, vehicles)}
        error={errorOf("vehicles")}
        pick={pick}
      />
    </div>
  );
}

/** The bearing of the lines: the edge server's, or a person's. */
function Direction({ form, found_deg, error, change }: {
  form: SurveyForm;
  found_deg: number | null;
  error: string | undefined;
  change: (part: Partial<SurveyForm>) => void;
}) {
  const { t } = useTranslation();
  const id = useId();
  const isAutomatic = form.direction_deg === "automatic";
  const shown = form.direction_deg === "automatic" ? found_deg : form.direction_deg;
  return (
    <>
      <Segments
        label={t("survey.direction")}
        options={[["automatic", t("survey.automatic")], ["chosen", t("survey.chosen")]]}
        value={isAutomatic ? "automatic" : "chosen"}
        choose={(kind) =>
          change({ direction_deg: kind === "automatic" ? "automatic" : Math.round(found_deg ?? 0) % 180 })
        }
      />
      <div className="range">
        <label htmlFor={id}>{t("survey.bearing")}</label>
        <input
          id={id}
          type="range"
          min={0}
          max={179}
          disabled={isAutomatic}
          aria-invalid={error !== undefined}
          aria-describedby={error === undefined ? undefined : `${id}-fault`}
          value={Math.round(shown ?? 0)}
          onChange={(event) => change({ direction_deg: event.target.valueAsNumber })}
        />
        <output htmlFor={id}>{shown === null ? "–" : `${Math.round(shown)}°`}</output>
      </div>
      {error !== undefined && <p className="fault" id={`${id}-fault`}>{error}</p>}
    </>
  );
}
