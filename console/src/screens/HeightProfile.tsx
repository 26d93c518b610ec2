import { useTranslation } from "react-i18next";
import type { Command } from "../api/types";
import { useUnits } from "../app/preferences";
import { heightProfile, lengthOf } from "../planning/height_profile";

const WIDTH = 320;
const HEIGHT = 84;
const MARGIN = 8;

/** The heights of a plan over its length, as a picture with its figures in words. */
export function HeightProfile({ commands, open }: { commands: readonly Command[]; open: number | null }) {
  const { t } = useTranslation();
  const units = useUnits();
  const profile = heightProfile(commands);
  if (profile.length < 3) return null;
  const length_m = lengthOf(profile);
  const top_m = Math.max(...profile.map((one) => one.height_m));
  const x = (distance_m: number) => MARGIN + (distance_m / (length_m || 1)) * (WIDTH - 2 * MARGIN);
  const y = (height_m: number) => HEIGHT - MARGIN - (height_m / (top_m || 1)) * (HEIGHT - 2 * MARGIN);
  const line = profile.map((one) => `${x(one.distance_m)},${y(one.height_m)}`).join(" ");
  const text = t("editor.profile", { length: units.distance(length_m), height: units.height(top_m) });
  return (
    <figure className="profile">
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={text}>
        <polygon points={`${x(0)},${y(0)} ${line} ${x(length_m)},${y(0)}`} />
        <polyline points={line} />
        {profile
          .filter((one) => one.height_m > 0)
          .map((one, at) => (
            <circle
              key={at}
              cx={x(one.distance_m)}
              cy={y(one.height_m)}
              r={one.index === open ? 5 : 3}
            />
          ))}
      </svg>
      <figcaption className="muted small">{text}</figcaption>
    </figure>
  );
}
