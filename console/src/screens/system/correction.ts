/** A rejected record as a person edits it. Pure. */

type Report = Readonly<Record<string, unknown>>;

/** Members that the edge server gives a record: nobody corrects them. */
const RECEIPT = ["id", "message_id", "received_at"];
/** A picture's bytes, which nobody edits as text; they stay as they are. */
const FRAME = "frame";

/** Writes what can be corrected of a report as indented JSON. */
export function editableOf(report: Report): string {
  const shown = Object.entries(report).filter(([name]) => name !== FRAME && !RECEIPT.includes(name));
  return JSON.stringify(Object.fromEntries(shown), null, 2);
}

/** Reads a corrected report, with the picture's bytes again; null if it is no JSON object. */
export function correctionOf(text: string, report: Report): Report | null {
  let read: unknown;
  try {
    read = JSON.parse(text);
  } catch {
    return null;
  }
  if (typeof read !== "object" || read === null || Array.isArray(read)) return null;
  return FRAME in report ? { ...read, [FRAME]: report[FRAME] } : { ...read };
}
