import { expect, test } from "vitest";
import type { Mission } from "../src/api/types";
import { lifeOf } from "../src/planning/plan_life";

const END = "2026-05-01T22:00:00Z";
const life = (mission: Partial<Mission>, now: string) =>
  lifeOf({ missions: [mission as Mission], expires_at: END }, Date.parse(now));

test("a plan that waits can be flown until it expires", () => {
  expect(life({ dispatch_state: "held" }, "2026-05-01T21:59:59Z")).toBe("open");
  expect(life({ dispatch_state: "queued" }, "2026-05-01T22:00:00Z")).toBe("expired");
  for (const message of ["expired before dispatch", "expired before take-off"]) {
    expect(life({ dispatch_state: "closed", message }, "2026-05-02T08:00:00Z")).toBe("expired");
  }
});

test("a plan that is flown or was has no such time", () => {
  expect(life({ dispatch_state: "accepted" }, "2026-05-01T23:00:00Z")).toBeNull();
  expect(life({ dispatch_state: "closed", message: "motor 3 stopped" }, "2026-05-01T23:00:00Z")).toBeNull();
});
