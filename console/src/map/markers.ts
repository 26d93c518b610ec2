/** Symbols on the map that are elements of the page, so that text needs no fonts of the map. */

const SVG = "http://www.w3.org/2000/svg";

/** Makes the symbol of a vehicle: an arrow in its heading, with its name below; a button where it can be selected. */
export function vehicleElement(label: string, select: (() => void) | null): HTMLElement {
  const element = document.createElement(select === null ? "span" : "button");
  if (element instanceof HTMLButtonElement) element.type = "button";
  else element.setAttribute("role", "img");
  element.className = "vehicle-marker";
  element.setAttribute("aria-label", label);
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 44 44");
  svg.setAttribute("aria-hidden", "true");
  const halo = document.createElementNS(SVG, "circle");
  halo.setAttribute("cx", "22");
  halo.setAttribute("cy", "22");
  halo.setAttribute("r", "20");
  const arrow = document.createElementNS(SVG, "path");
  arrow.setAttribute("d", "M22 6 34 34 22 28 10 34Z");
  svg.append(halo, arrow);
  const text = document.createElement("span");
  text.textContent = label;
  element.append(svg, text);
  element.classList.toggle("is-shown-only", select === null);
  element.addEventListener("click", (event) => {
    event.stopPropagation();
    select?.();
  });
  return element;
}

/** Turns the symbol and marks its state. */
export function updateVehicleElement(
  element: HTMLElement,
  heading_deg: number | null,
  status: string,
  isSelected: boolean,
): void {
  const arrow = element.querySelector("path");
  arrow?.setAttribute("transform", `rotate(${heading_deg ?? 0} 22 22)`);
  element.dataset["status"] = status;
  element.classList.toggle("is-selected", isSelected);
}

/** Makes the symbol of a place where pictures were taken, with their number: a pointer or the focus shows a small one. */
export function pictureElement(label: string, count: number, thumbnail: string | null, show: () => void): HTMLElement {
  const element = pointElement("picture-marker", label, show);
  if (count > 1) element.dataset["count"] = String(count);
  if (thumbnail === null) return element;
  const preview = document.createElement("img");
  preview.alt = "";
  preview.addEventListener("error", () => preview.remove());
  const load = () => {
    if (preview.src !== "") return;
    preview.src = thumbnail;
    element.append(preview);
  };
  element.addEventListener("pointerenter", load);
  element.addEventListener("focus", load);
  return element;
}

/** Makes the symbol of a home place. */
export function homeElement(label: string): HTMLElement {
  const element = document.createElement("span");
  element.className = "home-marker";
  nameAsPicture(element, label);
  element.title = label;
  element.textContent = "H";
  return element;
}

/** Makes the name of a field. */
export function nameElement(text: string): HTMLElement {
  const element = document.createElement("span");
  element.className = "name-marker";
  nameAsPicture(element, text);
  element.textContent = text;
  return element;
}

/** Without a role and a name the map makes each marker a button with a name of its own. */
function nameAsPicture(element: HTMLElement, name: string): void {
  element.setAttribute("role", "img");
  element.setAttribute("aria-label", name);
}

/** Makes the value of a measurement, above its place. */
export function valueElement(text: string): HTMLElement {
  const element = nameElement(text);
  element.classList.add("value-marker");
  element.setAttribute("role", "status");
  return element;
}

/** Makes the name of a flight, in the colour of its vehicle. */
export function flightElement(text: string, colour: number): HTMLElement {
  const element = nameElement(text);
  element.classList.add("flight-marker", `drone-colour-${colour}`);
  return element;
}

/** What a person does with a symbol from the keyboard. */
export interface SymbolKeys {
  select: () => void;
  remove: () => void;
  /** Steps of a metre, or of ten with Shift. */
  move: (north_m: number, east_m: number) => void;
}

const STEPS: Record<string, [north: number, east: number]> = {
  ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1],
};

/** Makes the symbol of a corner: arrow keys move it, Delete removes it. */
export function cornerElement(name: string, keys: SymbolKeys): HTMLElement {
  const element = pointElement("corner-marker", name, keys.select);
  listenToKeys(element, keys);
  return element;
}

/** Makes the numbered symbol of a command's place: the same keys move and remove it. */
export function waypointElement(label: string, name: string, keys: SymbolKeys): HTMLElement {
  const element = pointElement("waypoint-marker", name, keys.select);
  element.textContent = label;
  listenToKeys(element, keys);
  return element;
}

/** Marks whether the place is chosen, and what is wrong with its command. */
export function updateWaypointElement(
  element: HTMLElement,
  name: string,
  isSelected: boolean,
  faults: readonly string[],
): void {
  const text = [name, ...faults].join(": ");
  element.classList.toggle("is-selected", isSelected);
  element.classList.toggle("has-error", faults.length > 0);
  element.setAttribute("aria-label", text);
  element.title = text;
}

function listenToKeys(element: HTMLElement, keys: SymbolKeys): void {
  element.addEventListener("keydown", (event) => {
    const step = STEPS[event.key];
    if (step !== undefined) {
      const metres = event.shiftKey ? 10 : 1;
      keys.move(step[0] * metres, step[1] * metres);
    } else if (event.key === "Delete" || event.key === "Backspace") {
      keys.remove();
    } else {
      return;
    }
    // The map itself moves by the same keys
    event.preventDefault();
    event.stopPropagation();
  });
}

/** Makes the symbol of a field's entry, which can be moved like a corner where there are keys. */
export function entryElement(name: string, keys: SymbolKeys | null): HTMLElement {
  if (keys !== null) {
    const element = cornerElement(name, keys);
    element.classList.add("entry-marker");
    return element;
  }
  const element = document.createElement("span");
  element.className = "entry-marker";
  nameAsPicture(element, name);
  element.title = name;
  return element;
}

/** Makes the symbol in the middle of an edge, where a corner can be added. */
export function edgeElement(name: string, add: () => void): HTMLElement {
  return pointElement("edge-marker", name, add);
}

function pointElement(className: string, name: string, act: () => void): HTMLElement {
  const element = document.createElement("button");
  element.type = "button";
  element.className = className;
  element.setAttribute("aria-label", name);
  element.title = name;
  element.addEventListener("click", (event) => {
    event.stopPropagation();
    element.focus(); // The map keeps a press from doing so
    act();
  });
  return element;
}
