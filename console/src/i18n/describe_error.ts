/** Errors in plain words. */

import type { TFunction } from "i18next";
import { OtherPersonError, type RequestError } from "../api/client";

const KNOWN = new Set([0, 401, 403, 404, 409, 412, 413, 415, 422, 429, 503, 507]);

/** Says what happened and what can be done; the server's own reason follows where it has one. */
export function describeError(error: RequestError, t: TFunction): string {
  if (error instanceof OtherPersonError) return t("error.other_person");
  if (error.status === 429) {
    return error.retryAfterS === null
      ? t("error.429")
      : t("error.429_after", { seconds: error.retryAfterS });
  }
  const plain = KNOWN.has(error.status)
    ? t(`error.${error.status}`)
    : t("error.other", { status: error.status });
  const givesReason = error.status === 409 || error.status === 422 || error.status === 403;
  const reasons = error.faults.map((fault) => fault.text).slice(0, 3);
  const reason = reasons.length > 0 ? reasons.join("; ") : error.reason;
  return givesReason && reason ? `${plain} ${t("error.reason", { reason })}` : plain;
}
