import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { hasLink, presentSession, signInByLink, takeLink } from "./api/session";
import { App } from "./app/App";
import { readPreferences } from "./app/preferences";
import { LANGUAGES, showLanguage } from "./i18n/i18n";
import "./styles/tokens.css";
import "./styles/base.css";
import "./styles/controls.css";
import "./styles/shell.css";
import "./styles/fleet.css";
import "./styles/screens.css";

const SPLASH_AFTER_MS = 500;

const root = document.getElementById("root");
if (root === null) throw new Error("index.html has no element #root");
// Loaded while the session is read: the map is the largest part, and nearly every screen has one
void import("./map/FarmMap").catch(() => undefined);
// A link that is pasted into an open page changes the address alone: it is used as by a new page
window.addEventListener("hashchange", () => {
  if (hasLink()) window.location.reload();
});
const language = showLanguage(readPreferences(Object.keys(LANGUAGES)).language);
const link = takeLink();
const entering = link === null ? presentSession() : signInByLink(link);
const page = createRoot(root);
// Language and session are mostly known before the map is loaded: nothing is drawn that is gone at once
const known = Promise.all([language, entering.catch(() => undefined)]);
void Promise.race([known, pause(SPLASH_AFTER_MS)]).then(() =>
  page.render(
    <StrictMode>
      <App entering={entering} hasLink={link !== null} />
    </StrictMode>,
  ),
);

function pause(milliseconds: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, milliseconds));
}
