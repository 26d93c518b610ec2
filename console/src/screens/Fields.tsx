import { Suspense, useMemo, useState } from "react";
import { useTranslation } from "react-i18next";
import { listFields } from "../api/resources";
import type { StoredField } from "../api/types";
import { useUnits } from "../app/preferences";
import { go, linkTo } from "../app/route";
import { Button } from "../controls/Button";
import { Icon } from "../controls/Icon";
import { MoreRows } from "../controls/MoreRows";
import { Empty, Loaded } from "../controls/states";
import { useLive } from "../live/use_live";
import { useResource } from "../live/use_resource";
import { farmExtent } from "../map/farm_extent";
import { fieldFeatures } from "../map/features";
import { FarmMap } from "../map/map_part";
import { FieldFileDialog } from "./FieldFileDialog";
import { useFleetSymbols } from "./use_fleet_symbols";

const nothing = () => undefined;

/** Every field on the map, and the list of them. */
export default function Fields() {
  const { t } = useTranslation();
  const fields = useResource(listFields);
  const vehicles = useLive((state) => state.vehicles);
  const [isUploading, setUploading] = useState(false);
  const layers = useMemo(() => ({ fields: fieldFeatures(fields.value ?? []) }), [fields.value]);
  const symbols = useFleetSymbols(fields.value ?? [], null, nothing);
  const extent = useMemo(
    () => (fields.value === null ? null : farmExtent(fields.value, vehicles.values())),
    [fields.value, vehicles],
  );
  return (
    <div className="split">
      <div className="split-map">
        <Suspense fallback={<div className="farm-map" />}>
          <FarmMap layers={layers} symbols={symbols} extent={extent} label={t("map.label")} />
        </Suspense>
      </div>
      <section className="split-side">
        <h1>{t("fields.title")}</h1>
        <div className="actions">
          <Button kind="primary" icon="add" onClick={() => go("fields/new")}>
            {t("fields.new")}
          </Button>
          <Button icon="upload" onClick={() => setUploading(true)}>
            {t("fields.upload")}
          </Button>
        </div>
        <div className="card">
          <Loaded
            resource={fields}
            empty={<Empty icon="field" title={t("fields.empty_title")} text={t("fields.empty_text")} />}
          >
            {(rows) => (
              <MoreRows rows={rows}>{(field) => <FieldRow key={field.id} field={field} />}</MoreRows>
            )}
          </Loaded>
        </div>
      </section>
      {isUploading && (
        <FieldFileDialog
          close={() => setUploading(false)}
          stored={([first, ...others]) => {
            setUploading(false);
            // One field is shown at once; several are in the list
            if (first !== undefined && others.length === 0) go(`fields/${first.id}`);
            else fields.reload();
          }}
        />
      )}
    </div>
  );
}

function FieldRow({ field }: { field: StoredField }) {
  const { t } = useTranslation();
  const units = useUnits();
  const parts = [units.area(field.area_m2)];
  const name = field.name ?? t("fields.unnamed", { id: field.id });
  const excluded = field.exclusions?.length ?? 0;
  if (excluded > 0) parts.push(t("fields.exclusions", { count: excluded }));
  return (
    <li>
      <a className="row-main" {...linkTo(`fields/${field.id}`)}>
        <strong>{name}</strong>
        <span>{parts.join(" · ")}</span>
      </a>
      <a
        className="button button-plain"
        aria-label={t("fields.survey_of", { field: name })}
        {...linkTo(`fields/${field.id}/survey`)}
      >
        <Icon name="picture" />
        <span>{t("fields.survey")}</span>
      </a>
    </li>
  );
}
