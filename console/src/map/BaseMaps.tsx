import { useEffect, useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import type { Map as MapLibreMap } from "maplibre-gl";
import { listBaseMaps } from "../api/resources";
import type { BaseMap } from "../api/types";
import { useUnits } from "../app/preferences";
import { Icon } from "../controls/Icon";
import { useReportText } from "../i18n/use_report_text";
import { useResource } from "../live/use_resource";
import { drawBaseMaps, readShownMaps, storeShownMaps, type ShownMaps } from "./base_maps";
import { OpacitySlider } from "./OpacitySlider";
import { isSurvey, listSurveyMaps } from "./survey_maps";
import { VegetationLegend } from "./VegetationLegend";

/** The choice of base maps: which are shown, and how strongly; this browser keeps it. */
export function BaseMaps({ map, styles }: { map: MapLibreMap; styles: number }) {
  const { t } = useTranslation();
  const [isOpen, setOpen] = useState(false);
  /** The maps of surveys that are not shown are looked for when somebody may choose one. */
  const [hasOpened, setHasOpened] = useState(false);
  const [shown, setShown] = useState(readShownMaps);
  const [faults, setFaults] = useState<Record<string, string>>({});
  const files = useResource(listBaseMaps);
  const isAsked = hasOpened || Object.keys(shown).some(isSurvey);
  const surveys = useResource(() => (isAsked ? listSurveyMaps() : Promise.resolve([])), String(isAsked));
  const found = useMemo(
    () => (files.value === null ? null : [...files.value, ...(surveys.value ?? [])]),
    [files.value, surveys.value],
  );
  useEffect(() => {
    if (found === null) return;
    const control = new AbortController();
    void drawBaseMaps(map, found, shown, control.signal).then((failed) => {
      if (!control.signal.aborted) setFaults(failed);
    });
    return () => control.abort();
  }, [map, styles, found, shown]);

  const show = (next: ShownMaps) => {
    setShown(next);
    storeShownMaps(next);
  };
  const choose = (name: string, isShown: boolean) => {
    const { [name]: _, ...others } = shown;
    show(isShown ? { ...others, [name]: 1 } : others);
  };
  if (found === null) return null;
  return (
    <div className="base-maps">
      <button
        type="button"
        aria-label={t("map.layers")}
        aria-expanded={isOpen}
        onClick={() => {
          setOpen(!isOpen);
          setHasOpened(true);
        }}
      >
        <Icon name="layers" />
      </button>
      {isOpen && (
        <fieldset onKeyDown={(event) => event.key === "Escape" && setOpen(false)}>
          <legend>{t("map.layers")}</legend>
          {found.length === 0 && !surveys.isLoading && <p className="muted">{t("map.no_layers")}</p>}
          {found.map((one) => (
            <BaseMapChoice
              key={one.name}
              map={one}
              opacity={one.fault === null ? shown[one.name] : undefined}
              fault={one.fault ?? faults[one.name]}
              choose={(isShown) => choose(one.name, isShown)}
              change={(opacity) => show({ ...shown, [one.name]: opacity })}
            />
          ))}
          {surveys.isLoading && <p className="muted small">{t("map.surveys_loading")}</p>}
        </fieldset>
      )}
    </div>
  );
}

function BaseMapChoice({ map: { name, kind, survey, fault: unreadable }, opacity, fault, choose, change }: {
  map: BaseMap;
  /** Undefined: it is not shown. */
  opacity: number | undefined;
  fault: string | undefined;
  choose: (isShown: boolean) => void;
  change: (opacity: number) => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const reportText = useReportText();
  const isIndex = kind === "vegetation_index";
  const label = survey === undefined
    ? name.replace(/\.[^.]+$/, "")
    : t(isIndex ? "map.survey_index" : "map.survey", {
        id: survey.flightId,
        what: [t("vehicle.name", { id: survey.vehicleId }), survey.planName].filter(Boolean).join(" · "),
        time: units.time(survey.madeAt),
      });
  return (
    <div>
      <label>
        <input
          type="checkbox"
          checked={opacity !== undefined}
          disabled={unreadable !== null}
          onChange={(event) => choose(event.target.checked)}
        />
        <span>{label}</span>
      </label>
      {fault && <p className="small">{reportText(fault)}</p>}
      {isIndex && opacity !== undefined && <VegetationLegend />}
      {opacity !== undefined && (
        <OpacitySlider
          label={t("map.opacity", { name: survey === undefined ? name : label })}
          value={opacity}
          change={change}
        />
      )}
    </div>
  );
}
