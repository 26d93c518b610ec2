import { useTranslation } from "react-i18next";
import type { StatusId } from "../api/types";

export type Tone = "neutral" | "active" | "good" | "warning" | "bad";

const TONES: Record<StatusId, Tone> = { 1: "neutral", 2: "active", 3: "good", 4: "bad", 5: "warning" };

/** A state in one or two plain terms; the colour only repeats what the text says. */
export function Pill({ tone, children }: { tone: Tone; children: string }) {
  return <span className={`pill pill-${tone}`}>{children}</span>;
}

/** The status of a mission, plan or command. */
export function StatusPill({ status }: { status: StatusId }) {
  const { t } = useTranslation();
  return <Pill tone={TONES[status]}>{t(`status.${status}`)}</Pill>;
}
