import { useEffect, useState } from "react";
import { useTranslation } from "react-i18next";
import { RequestError } from "../../api/client";
import { makeFlightMap } from "../../api/resources";
import type { FlightMap } from "../../api/types";
import { useUnits } from "../../app/preferences";
import { useIsOperator } from "../../app/session_context";
import { Button } from "../../controls/Button";
import { Icon } from "../../controls/Icon";
import { OpacitySlider } from "../../map/OpacitySlider";
import { VegetationLegend } from "../../map/VegetationLegend";
import { ErrorNotice, Notice } from "../../controls/states";
import { asRequestError, type Resource } from "../../live/use_resource";

const ASK_MS = 2_000;

const NAMES = {
  rgb: { title: "flights.map", show: "flights.map_show", opacity: "flights.map_opacity" },
  ndvi: { title: "flights.index_map", show: "flights.index_map_show", opacity: "flights.index_map_opacity" },
} as const;

/** Whether something lies on the map, and how strongly; null shows nothing. */
export function LayerChoice({ label, sliderLabel, opacity, change }: {
  label: string;
  sliderLabel: string;
  opacity: number | null;
  change: (opacity: number | null) => void;
}) {
  return (
    <div className="picture-map">
      <label>
        <input
          type="checkbox"
          checked={opacity !== null}
          onChange={(event) => change(event.target.checked ? 1 : null)}
        />
        <span>{label}</span>
      </label>
      {opacity !== null && <OpacitySlider label={sliderLabel} value={opacity} change={change} />}
    </div>
  );
}

/** The map that the edge server makes of a survey's pictures: its state, and how to show or make it. */
export function SurveyMap({ flightId, band, resource, opacity, change }: {
  flightId: number;
  band: "rgb" | "ndvi";
  resource: Resource<FlightMap>;
  opacity: number | null;
  change: (opacity: number | null) => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const isOperator = useIsOperator();
  const [error, setError] = useState<RequestError | null>(null);
  const { value: map, reload } = resource;
  const [isAsked, setAsked] = useState(false);
  const isMaking = map?.state === "making" || isAsked;
  useEffect(() => {
    if (!isMaking) return;
    const timer = setInterval(reload, ASK_MS);
    return () => clearInterval(timer);
  }, [isMaking, reload]);
  if (map === null) return null;
  const make = () => {
    setError(null);
    setAsked(true);
    makeFlightMap(flightId, band)
      .then(reload)
      .catch((reason: unknown) => setError(asRequestError(reason)))
      .finally(() => setAsked(false));
  };
  return (
    <section className="survey-map">
      <h3>{t(NAMES[band].title)}</h3>
      {map.state === "failed" && <Notice kind="error">{t("flights.map_failed", { reason: map.reason })}</Notice>}
      {error && <ErrorNotice error={error} />}
      {map.url !== null && map.metres_per_px !== null && (
        <>
          <LayerChoice
            label={t(NAMES[band].show)}
            sliderLabel={t(NAMES[band].opacity)}
            opacity={opacity}
            change={change}
          />
          {band === "ndvi" && opacity !== null && <VegetationLegend />}
          <p className="muted small">
            {t("flights.map_about", { count: map.pictures, time: units.time(map.made_at), size: Math.max(1, Math.round(map.metres_per_px * 100)) })}
          </p>
        </>
      )}
      <div className="actions">
        {isOperator && (
          <Button icon="map" isBusy={isMaking} onClick={make}>
            {t(isMaking ? "flights.map_making" : map.url === null ? "flights.map_make" : "flights.map_again")}
          </Button>
        )}
        {map.url !== null && (
          <a className="button button-plain" href={map.url} download={`flight-${flightId}-${band}-map.webp`}>
            <Icon name="download" /> {t("flights.map_download")}
          </a>
        )}
      </div>
      {map.url === null && !isOperator && <p className="muted">{t("flights.map_none")}</p>}
    </section>
  );
}
