/** Names, roles and times of accounts and keys, as the edge server takes them. Pure. */

import type { Role } from "../../api/types";

export const PERSON_ROLES = ["farmer", "operator", "admin"] as const satisfies readonly Role[];
export const KEY_ROLES = ["broker", "cloud", "farmer", "operator", "admin"] as const satisfies readonly Role[];
export const NAME_PATTERN = "[A-Za-z0-9][A-Za-z0-9._\\-]{0,63}";
export const SHORTEST_PASSWORD = 10;
export const LONGEST_PASSWORD = 200;

/** The end of a day that was chosen in a date field, in the browser's time zone; null for none. */
export function endOfDay(date: string): string | null {
  const end = new Date(`${date}T23:59:59`);
  return Number.isNaN(end.getTime()) ? null : end.toISOString();
}

/** The address that signs a person in once, at the server from which the console came. */
export function signInAddress(path: string, origin: string): string {
  return new URL(path, origin).href;
}
