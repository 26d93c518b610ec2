import { useTranslation } from "react-i18next";
import type { Fault } from "../api/client";
import { useUnits } from "../app/preferences";
import { Button } from "../controls/Button";
import { areaOf_m2, FEWEST_CORNERS, ringOfFault, ringsOf, type Outline, type RingName } from "../planning/outline";

/** The boundary and the areas in it, one of which is drawn; each with its own faults. */
export function RingList({ outline, chosen, faults, choose, add, remove }: {
  outline: Outline;
  chosen: RingName;
  faults: readonly Fault[];
  choose: (name: RingName) => void;
  add: () => void;
  remove: (name: RingName) => void;
}) {
  const { t } = useTranslation();
  const units = useUnits();
  return (
    <>
      <ul className="steps" aria-label={t("fields.rings")}>
        {ringsOf(outline).map(([name, ring]) => {
          const [kind = "", index = "0"] = name.split(".");
          const title = t(`fields.ring_${kind}`, { number: Number(index) + 1 });
          const found = faults.filter((fault) => ringOfFault(fault.path) === name);
          return (
            <li
              key={name}
              className={`step ${name === chosen ? "is-open" : ""} ${found.length > 0 ? "has-error" : ""}`}
            >
              <div className="step-head">
                <button
                  type="button"
                  className="step-title"
                  aria-pressed={name === chosen}
                  onClick={() => choose(name)}
                >
                  {title}
                  <small>
                    {ring.length < FEWEST_CORNERS
                      ? t("fields.few_corners")
                      : `${t("fields.corners", { count: ring.length })} · ${units.area(areaOf_m2(ring))}`}
                  </small>
                </button>
                {name !== "boundary" && (
                  <Button
                    kind="quiet"
                    icon="remove"
                    aria-label={t("fields.remove_ring", { name: title })}
                    onClick={() => remove(name)}
                  />
                )}
              </div>
              {found.length > 0 && (
                <div className="step-body">
                  {found.map((fault) => (
                    <p key={fault.path + fault.text} className="fault">{fault.text}</p>
                  ))}
                </div>
              )}
            </li>
          );
        })}
      </ul>
      <div className="actions">
        <Button icon="add" disabled={outline.boundary.length < FEWEST_CORNERS} onClick={add}>
          {t("fields.add_exclusion")}
        </Button>
      </div>
    </>
  );
}
