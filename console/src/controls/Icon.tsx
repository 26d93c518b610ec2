/** Icons as outlines on a grid of 24; decorative, so they are hidden from screen readers. */

const PATHS = {
  map: "M3 6l6-2 6 2 6-2v14l-6 2-6-2-6 2zM9 4v14M15 6v14",
  field: "M4 5l9-2 7 8-4 9-11-3zM4 5h.01M13 3h.01M20 11h.01M16 20h.01M5 17h.01",
  plan: "M5 19a2 2 0 1 0 0-4 2 2 0 0 0 0 4zM19 9a2 2 0 1 0 0-4 2 2 0 0 0 0 4zM7 17h8a3.5 3.5 0 0 0 0-7H9a3.5 3.5 0 0 1 0-7h2",
  flight: "M12 8v4l3 2M21 12a9 9 0 1 1-3-6.700M21 3v5h-5",
  alarm: "M12 3a6 6 0 0 0-6 6c0 6-2 7-2 7h16s-2-1-2-7a6 6 0 0 0-6-6zM10 20a2 2 0 0 0 4 0",
  system: "M4 7h10M18 7h2M4 17h4M12 17h8M14 4v6M8 14v6",
  signOut: "M15 4h4v16h-4M10 8l-4 4 4 4M6 12h10",
  land: "M12 3v12M7 10l5 5 5-5M5 20h14",
  home: "M4 11l8-7 8 7M6 9.500V20h12V9.500M10 20v-6h4v6",
  stop: "M8 3h8l5 5v8l-5 5H8l-5-5V8z",
  battery: "M3 8h15v8H3zM21 11v2",
  speed: "M4 17a9 9 0 1 1 16 0M12 14l4-5",
  height: "M12 4v16M8 8l4-4 4 4M5 20h14",
  link: "M5 12a10 10 0 0 1 14 0M8 15a6 6 0 0 1 8 0M12 19h.01M2 9a14 14 0 0 1 20 0",
  locate: "M12 2v4M12 18v4M2 12h4M18 12h4M12 6a6 6 0 1 0 0 12 6 6 0 0 0 0-12z",
  upload: "M12 16V4M7 9l5-5 5 5M4 20h16",
  sound: "M4 10v4h4l5 4V6L8 10zM16 9a4 4 0 0 1 0 6M18.5 6.500a8 8 0 0 1 0 11",
  soundOff: "M4 10v4h4l5 4V6L8 10zM17 10l4 4M21 10l-4 4",
  undo: "M9 14L4 9l5-5M4 9h10a6 6 0 0 1 0 12h-3",
  redo: "M15 14l5-5-5-5M20 9H10a6 6 0 0 0 0 12h3",
  download: "M12 4v12M7 11l5 5 5-5M4 20h16",
  add: "M12 5v14M5 12h14",
  copy: "M9 9h11v11H9zM5 15H4V4h11v1",
  remove: "M5 7h14M10 7V4h4v3M7 7l1 13h8l1-13",
  up: "M6 15l6-6 6 6",
  down: "M6 9l6 6 6-6",
  close: "M6 6l12 12M18 6L6 18",
  check: "M5 12.500l4.5 4.500L19 7",
  warning: "M12 4L2.5 20h19zM12 10v4M12 17h.01",
  back: "M15 5l-7 7 7 7",
  settings: "M12 15a3 3 0 1 0 0-6 3 3 0 0 0 0 6zM19 12l2-1-1-3-2.3.2-1.4-1.400L16.5 4.500l-3-1L12 5.500h-1L9.5 3.500l-3 1 .2 2.3-1.4 1.400L3 8l-1 3 2 1v1l-1 3 3 1 2 1.5 1 2.500h4l1-2.5 2-1.5 3-1-1-3z",
  cloud: "M7 18a4 4 0 0 1-.5-8A6 6 0 0 1 18 9.5 4.3 4.3 0 0 1 17.5 18z",
  picture: "M3 5h18v14H3zM3 16l5-5 5 5 3-3 5 5M16 9h.01",
  layers: "M12 3l9 5-9 5-9-5zM3.500 12.500L12 17l8.500-4.500M3.500 16.500L12 21l8.500-4.500",
  fit: "M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5",
  play: "M7 4l13 8-13 8z",
  pause: "M8 5v14M16 5v14",
} as const;

export type IconName = keyof typeof PATHS;

/** An outline icon in the colour of the text around it. */
export function Icon({ name, size = 20 }: { name: IconName; size?: number }) {
  return (
    <svg
      className="icon"
      width={size}
      height={size}
      viewBox="0 0 24 24"
      fill="none"
      stroke="currentColor"
      strokeWidth="1.8"
      strokeLinecap="round"
      strokeLinejoin="round"
      aria-hidden="true"
    >
      <path d={PATHS[name]} />
    </svg>
  );
}
