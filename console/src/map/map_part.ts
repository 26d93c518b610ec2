/** The map for screens, which is loaded beside them. */

import { part } from "../app/part";

export const FarmMap = part(() => import("./FarmMap"));
