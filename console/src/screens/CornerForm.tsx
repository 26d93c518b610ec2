import { useState } from "react";
import { useTranslation } from "react-i18next";
import { Button } from "../controls/Button";
import { NumberField } from "../controls/NumberField";
import type { Corner } from "../planning/outline";

/** Place of the corner or the entry that is selected, in degrees. */
export function CornerForm({ title, corner, move, remove, removeText, canRemove = true }: {
  title: string;
  corner: Corner;
  move: (corner: Corner) => void;
  remove: () => void;
  removeText: string;
  canRemove?: boolean;
}) {
  const { t } = useTranslation();
  const [latitude, longitude] = corner;
  const [fault, setFault] = useState<{ label: string; text: string; of: string } | null>(null);
  const place = corner.join();
  const field = (label: string, value: number, limit: number, set: (degrees: number) => void) => (
    <NumberField
      label={label}
      value={value}
      shown={String(value)}
      keepsFaults
      error={fault?.label === label && fault.of === place ? fault.text : undefined}
      enter={(degrees) => {
        const isNumber = degrees !== null && !Number.isNaN(degrees);
        if (isNumber && Math.abs(degrees) <= limit) {
          setFault(null);
          set(degrees);
          return degrees;
        }
        const range = t("editor.range", { low: -limit, high: limit });
        setFault({ label, of: place, text: isNumber ? t("editor.out_of_range", { range }) : t("editor.number") });
        return value; // Not taken: what is typed stays, with the reason, until the corner is another one
      }}
    />
  );
  return (
    <fieldset className="corner-form">
      <legend>{title}</legend>
      <div className="form-line">
        {field(t("parameter.latitude"), latitude, 90, (degrees) => move([degrees, longitude]))}
        {field(t("parameter.longitude"), longitude, 180, (degrees) => move([latitude, degrees]))}
        <Button icon="remove" disabled={!canRemove} onClick={remove}>{removeText}</Button>
      </div>
    </fieldset>
  );
}
