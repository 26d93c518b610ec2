import { useState, type ReactNode } from "react";
import { useTranslation } from "react-i18next";
import { Button } from "./Button";

const PAGE = 50;

/** The first rows of a long list, and a button for the next ones. */
export function MoreRows<Row>({ rows, children }: { rows: Row[]; children: (row: Row) => ReactNode }) {
  const { t } = useTranslation();
  const [shown, setShown] = useState(PAGE);
  return (
    <>
      <ul className="rows">{rows.slice(0, shown).map(children)}</ul>
      {rows.length > shown && (
        <div className="more-rows">
          <Button icon="down" onClick={() => setShown(shown + PAGE)}>
            {t("action.more", { count: rows.length - shown })}
          </Button>
        </div>
      )}
    </>
  );
}
