import { useMemo, type PointerEvent } from "react";
import { useTranslation } from "react-i18next";
import { useUnits } from "../../app/preferences";
import { rangeOf, thinned, type Sample } from "../../flights/plot";
import { momentAt, partAt, timeAt, type TrackPoint } from "../../flights/track";
import type { Replay } from "../../flights/use_replay";

const WIDTH = 340;
const HEIGHT = 84;
const TOP = 10;
const BOTTOM = 4;
const PARTS = 170;

/** Something that happened during the flight. */
export interface Mark {
  at_ms: number;
  text: string;
  kind: "alarm" | "step";
}

/** Height and speed over the time of a flight; a touch shows that moment on the map. */
export function FlightPlots({ points, replay, marks }: {
  points: TrackPoint[];
  replay: Replay;
  marks: Mark[];
}) {
  const { t } = useTranslation();
  const units = useUnits();
  const [heights, speeds] = useMemo(
    () => [
      points.map((one): Sample => ({ at_ms: one.at_ms, value: one.height_m })),
      points.flatMap((one): Sample[] =>
        one.speed_m_s === null ? [] : [{ at_ms: one.at_ms, value: one.speed_m_s }],
      ),
    ],
    [points],
  );
  const present = momentAt(points, replay.part);
  if (present === null) return null;
  const common = { points, replay, marks };
  const alarms = marks.filter((mark) => mark.kind === "alarm");
  return (
    <>
      <Plot
        {...common}
        samples={heights}
        title={t("flights.height")}
        present={units.height(present.height_m)}
        write={(value) => units.height(value)}
      />
      {speeds.length > 1 && (
        <Plot
          {...common}
          samples={speeds}
          title={t("flights.speed")}
          present={units.speed(present.speed_m_s)}
          write={(value) => units.speed(value)}
        />
      )}
      <p className="plot-times muted small">
        <span>{units.clock(timeAt(points, 0))}</span>
        <strong>{units.clock(present.at_ms)}</strong>
        <span>{units.clock(timeAt(points, 1))}</span>
      </p>
      {alarms.length > 0 && (
        <ul className="plot-alarms" aria-label={t("flights.alarms")}>
          {alarms.map((mark, index) => (
            <li key={index}>
              <button type="button" onClick={() => replay.show(partAt(points, mark.at_ms))}>
                <span className="muted">{units.clock(mark.at_ms)}</span> {mark.text}
              </button>
            </li>
          ))}
        </ul>
      )}
    </>
  );
}

function Plot({ points, samples, replay, marks, title, present, write }: {
  points: TrackPoint[];
  samples: Sample[];
  replay: Replay;
  marks: Mark[];
  title: string;
  present: string;
  write: (value: number) => string;
}) {
  const { t } = useTranslation();
  const drawn = useMemo(() => {
    const [low, high] = rangeOf(samples);
    const x = (at_ms: number) => partAt(points, at_ms) * WIDTH;
    const y = (value: number) => HEIGHT - BOTTOM - ((value - low) / (high - low)) * (HEIGHT - TOP - BOTTOM);
    const line = thinned(samples, PARTS).map((one) => `${x(one.at_ms).toFixed(1)},${y(one.value).toFixed(1)}`);
    return { line: line.join(" "), ground: y(0), high, x };
  }, [points, samples]);
  const highest = write(drawn.high);
  const show = (event: PointerEvent<SVGSVGElement>) => {
    if (event.type === "pointermove" && event.buttons === 0) return;
    const { left, width } = event.currentTarget.getBoundingClientRect();
    replay.show(Math.min(1, Math.max(0, (event.clientX - left) / width)));
  };
  const now = replay.part * WIDTH;
  return (
    <figure className="plot">
      <figcaption>
        <span>{title}</span> <strong>{present}</strong>
        <span className="muted small">{t("flights.at_most", { value: highest })}</span>
      </figcaption>
      <svg
        viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
        preserveAspectRatio="none"
        role="img"
        aria-label={`${title}: ${present}, ${t("flights.at_most", { value: highest })}`}
        onPointerDown={show}
        onPointerMove={show}
      >
        <polygon points={`0,${drawn.ground} ${drawn.line} ${WIDTH},${drawn.ground}`} />
        <line className="plot-ground" x1={0} x2={WIDTH} y1={drawn.ground} y2={drawn.ground} />
        {marks.map((mark, index) => (
          <line
            key={index}
            className={`plot-${mark.kind}`}
            x1={drawn.x(mark.at_ms)}
            x2={drawn.x(mark.at_ms)}
            y1={mark.kind === "alarm" ? 0 : HEIGHT - 14}
            y2={HEIGHT}
          >
            <title>{mark.text}</title>
          </line>
        ))}
        <polyline points={drawn.line} />
        <line className="plot-now" x1={now} x2={now} y1={0} y2={HEIGHT} />
      </svg>
    </figure>
  );
}
