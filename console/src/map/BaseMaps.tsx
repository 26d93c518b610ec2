import { useEffect, useState } from "react";
import { useTranslation } from "react-i18next";
import type { Map as MapLibreMap } from "maplibre-gl";
import { listBaseMaps } from "../api/resources";
import { Icon } from "../controls/Icon";
import { useResource } from "../live/use_resource";
import { drawBaseMaps, readShownMaps, storeShownMaps, type ShownMaps } from "./base_maps";
import { VegetationLegend } from "./VegetationLegend";

/** The choice of base maps: which are shown, and how strongly; this browser keeps it. */
export function BaseMaps({ map, styles }: { map: MapLibreMap; styles: number }) {
  const { t } = useTranslation();
  const [isOpen, setOpen] = useState(false);
  const [shown, setShown] = useState(readShownMaps);
  const [faults, setFaults] = useState<Record<string, string>>({});
  const maps = useResource(listBaseMaps);
  const found = maps.value;
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
        onClick={() => setOpen(!isOpen)}
      >
        <Icon name="layers" />
      </button>
      {isOpen && (
        <fieldset onKeyDown={(event) => event.key === "Escape" && setOpen(false)}>
          <legend>{t("map.layers")}</legend>
          {found.length === 0 && <p className="muted">{t("map.no_layers")}</p>}
          {found.map(({ name, kind, fault }) => (
            <div key={name}>
              <label>
                <input
                  type="checkbox"
                  checked={name in shown && fault === null}
                  disabled={fault !== null}
                  onChange={(event) => choose(name, event.target.checked)}
                />
                <span>{name.replace(/\.[^.]+$/, "")}</span>
              </label>
              {(fault ?? faults[name]) && <p className="small">{fault ?? faults[name]}</p>}
              {kind === "vegetation_index" && name in shown && <VegetationLegend />}
              {name in shown && fault === null && (
                <input
                  type="range"
                  min={0.1}
                  max={1}
                  step={0.05}
                  value={shown[name]}
                  aria-label={t("map.opacity", { name })}
                  onChange={(event) => show({ ...shown, [name]: Number(event.target.value) })}
                />
              )}
            </div>
          ))}
        </fieldset>
      )}
    </div>
  );
}
