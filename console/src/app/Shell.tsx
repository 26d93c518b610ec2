import { Suspense, useCallback, useEffect, useState } from "react";
import { useTranslation } from "react-i18next";
import { Empty, Skeleton } from "../controls/states";
import { StopContext, type Stop } from "../controls/StopButton";
import { useAlarmSound } from "../live/alarm_sound";
import type { Feed } from "../live/feed";
import { FeedContext } from "../live/use_live";
import { Fleet } from "../screens/Fleet";
import { StopDialog } from "../screens/StopDialog";
import { Boundary } from "./Boundary";
import { Header } from "./Header";
import { Navigation } from "./Navigation";
import { part } from "./part";
import { usePreload } from "./preload";
import { LANGUAGES, loadLanguage } from "../i18n/i18n";
import { FarmMap } from "../map/map_part";
import { numberOf, useRoute } from "./route";
import { useTitle } from "./use_title";

const Fields = part(() => import("../screens/Fields"));
const FieldEditor = part(() => import("../screens/FieldEditor"));
const SurveyEditor = part(() => import("../screens/SurveyEditor"));
const Plans = part(() => import("../screens/Plans"));
const PlanEditor = part(() => import("../screens/PlanEditor"));
const PlanView = part(() => import("../screens/PlanView"));
const Flights = part(() => import("../screens/Flights"));
const FlightView = part(() => import("../screens/FlightView"));
const Alarms = part(() => import("../screens/Alarms"));
const System = part(() => import("../screens/System"));
/** Those that a person is likely to need without a connection first. */
const PARTS = [
  FarmMap, PlanView, Plans, Alarms, Flights, FlightView, Fields, PlanEditor, FieldEditor, SurveyEditor, System,
  ...Object.keys(LANGUAGES).map((code) => ({ preload: () => loadLanguage(code).then(() => true, () => false) })),
];

/** Header, navigation and the screen of the present address. */
export function Shell({ feed }: { feed: Feed }) {
  const { t } = useTranslation();
  const [stops, setStops] = useState<{ vehicleId: number | null } | null>(null);
  const stop = useCallback<Stop>((vehicleId) => setStops({ vehicleId }), []);
  useEffect(() => {
    feed.start();
    return () => feed.stop();
  }, [feed]);

  return (
    <FeedContext value={feed}>
    <StopContext value={stop}>
      <a className="skip" href="#content">
        {t("shell.skip")}
      </a>
      <div className="shell">
        <Header />
        <Navigation />
        <main id="content" tabIndex={-1}>
          <AlarmSound />
          <Preload />
          <Content />
        </main>
      </div>
      {stops && <StopDialog vehicleId={stops.vehicleId} close={() => setStops(null)} />}
    </StopContext>
    </FeedContext>
  );
}

/** Inside the feed: new alarms sound on every screen. */
function AlarmSound() {
  useAlarmSound();
  return null;
}

/** Inside the feed: it tells whether there is a connection. */
function Preload() {
  usePreload(PARTS);
  return null;
}

function Content() {
  const route = useRoute();
  useTitle(route[0]);
  return (
    <Boundary place={route.join("/")}>
      <Suspense fallback={<Skeleton />}>
        <Screen route={route} />
      </Suspense>
    </Boundary>
  );
}

function Screen({ route: [first, second, third] }: { route: string[] }) {
  switch (first) {
    case undefined:
      return <Fleet />;
    case "fields":
      if (second === undefined) return <Fields />;
      if (second !== "new" && numberOf(second) === null) return <Nothing />;
      if (third === "survey") return <SurveyEditor key={second} fieldId={Number(second)} />;
      return <FieldEditor key={second} id={second === "new" ? null : Number(second)} />;
    case "plans":
      if (second === undefined) return <Plans />;
      if (second === "new") return <PlanEditor reference={null} />;
      if (third === "edit") return <PlanEditor key={second} reference={second} />;
      return <PlanView key={second} reference={second} />;
    case "flights":
      if (second === undefined) return <Flights />;
      return numberOf(second) === null ? <Nothing /> : <FlightView key={second} id={Number(second)} />;
    case "alarms":
      return <Alarms />;
    case "system":
      return <System key={second} section={second ?? "users"} />; // Another section has not failed
    default:
      return <Nothing />;
  }
}

function Nothing() {
  const { t } = useTranslation();
  return <Empty isScreen icon="map" title={t("shell.not_found")} />;
}
