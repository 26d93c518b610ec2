import { useTranslation } from "react-i18next";

/** A quiet page while the console finds out who is signed in. */
export function Splash() {
  const { t } = useTranslation();
  return (
    <div className="splash" role="status">
      <span className="spinner spinner-large" />
      <span className="visually-hidden">{t("state.loading")}</span>
    </div>
  );
}
