import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { presentSession, signInByLink, takeLink } from "./api/session";
import { App } from "./app/App";
import "./i18n/i18n";
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
const link = takeLink();
const entering = link === null ? presentSession() : signInByLink(link);
const page = createRoot(root);
// The session is mostly known before the map is loaded: nothing is drawn that is gone at once
void Promise.race([entering.catch(() => undefined), pause(SPLASH_AFTER_MS)]).then(() =>
  page.render(
    <StrictMode>
      <App entering={entering} hasLink={link !== null} />
    </StrictMode>,
  ),
);

function pause(milliseconds: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, milliseconds));
}
