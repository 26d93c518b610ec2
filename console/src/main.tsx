import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { App } from "./app/App";
import "./i18n/i18n";
import "./styles/tokens.css";
import "./styles/base.css";
import "./styles/controls.css";
import "./styles/shell.css";
import "./styles/fleet.css";
import "./styles/screens.css";

const root = document.getElementById("root");
if (root === null) throw new Error("index.html has no element #root");
// Loaded while the session is read: the map is the largest part, and nearly every screen has one
void import("./map/FarmMap").catch(() => undefined);
createRoot(root).render(
  <StrictMode>
    <App />
  </StrictMode>,
);
