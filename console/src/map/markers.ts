/** Symbols on the map that are elements of the page, so that text needs no fonts of the map. */

const SVG = "http://www.w3.org/2000/svg";

/** Makes the symbol of a vehicle: an arrow in its heading, with its name below. */
export function vehicleElement(label: string, select: () => void): HTMLElement {
  const element = document.createElement("button");
  element.type = "button";
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
  element.addEventListener("click", (event) => {
    event.stopPropagation();
    select();
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

/** Makes the symbol of a place where pictures were taken: it opens the first of them. */
export function pictureElement(label: string, url: string): HTMLElement {
  const element = document.createElement("a");
  element.className = "picture-marker";
  element.href = url;
  element.target = "_blank";
  element.rel = "noreferrer";
  element.setAttribute("aria-label", label);
  element.title = label;
  element.addEventListener("click", (event) => event.stopPropagation());
  return element;
}

/** Makes the symbol of a home place. */
export function homeElement(label: string): HTMLElement {
  const element = document.createElement("span");
  element.className = "home-marker";
  element.title = label;
  element.textContent = "H";
  return element;
}

/** Makes the name of a field. */
export function nameElement(text: string): HTMLElement {
  const element = document.createElement("span");
  element.className = "name-marker";
  element.textContent = text;
  return element;
}

/** Makes the numbered symbol of a command's place. */
export function waypointElement(label: string, name: string, select: () => void): HTMLElement {
  const element = document.createElement("button");
  element.type = "button";
  element.className = "waypoint-marker";
  element.setAttribute("aria-label", name);
  element.textContent = label;
  element.addEventListener("click", (event) => {
    event.stopPropagation();
    select();
  });
  return element;
}
