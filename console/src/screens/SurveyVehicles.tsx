import { useTranslation } from "react-i18next";
import { useUnits } from "../app/preferences";
import { useLive } from "../live/use_live";
import type { SurveyFlight } from "../map/survey_features";

/** Who takes part: each vehicle with its colour on the map and its share. */
export function SurveyVehicles({ chosen, flights, colour, error, pick }: {
  chosen: readonly number[];
  flights: readonly SurveyFlight[];
  colour: (vehicleId: number) => number;
  error: string | undefined;
  pick: (vehicles: number[]) => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const known = useLive((state) => state.vehicles);
  const ids = [...new Set([...known.keys(), ...chosen])].sort((one, other) => one - other);
  return (
    <fieldset className="checks">
      <legend>{t("survey.vehicles")}</legend>
      {ids.map((id) => {
        const isChosen = chosen.includes(id);
        const own = flights.filter((flight) => flight.vehicleId === id);
        const pictures = own.reduce((sum, flight) => sum + flight.pictures.length, 0);
        return (
          <label key={id} className={`check ${isChosen ? `drone-colour-${colour(id)}` : ""}`}>
            <input
              type="checkbox"
              checked={isChosen}
              onChange={() =>
                pick(ids.filter((one) => (one === id ? !isChosen : chosen.includes(one))))
              }
            />
            <span className="swatch" />
            {t("vehicle.name", { id })}
            {isChosen && own.length > 0 && (
              <small>
                {t("survey.share", { count: own.length, pictures: units.count(pictures) })}
              </small>
            )}
          </label>
        );
      })}
      {error !== undefined && <p className="fault">{error}</p>}
    </fieldset>
  );
}
