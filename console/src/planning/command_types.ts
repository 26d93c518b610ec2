/** Numbers of AFarCloud's commands that the console treats apart from others. */

export const TAKEOFF = 1;
export const LAND = 2;
export const WAYPOINT = 3;
export const PICTURE = 4;
export const CIRCLE = 7;
export const HOME = 11;
