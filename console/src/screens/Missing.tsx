import { useTranslation } from "react-i18next";
import { Empty } from "../controls/states";

/** For a part of the console that this edge server does not have. */
export function Missing() {
  const { t } = useTranslation();
  return <Empty isScreen icon="system" title={t("shell.missing_title")} text={t("shell.missing_text")} />;
}
