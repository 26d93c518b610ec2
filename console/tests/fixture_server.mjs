// An edge server for the development of screens: a few answers by its contract, and one vehicle
// that flies a rectangle. It serves dist/ with the edge server's security policy.
// Node only, nothing is stored: `npm run fixture`, then http://127.0.0.1:8765/console/
// (any name; the password is "farm"; the name "admin" is an administrator).
import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { extname, join, normalize } from "node:path";

const PORT = Number(process.env.PORT ?? 8765);
const DIST = new URL("../dist/", import.meta.url).pathname;
const POLICY =
  "default-src 'self'; img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self'; " +
  "object-src 'none'; form-action 'self'; frame-ancestors 'none'; base-uri 'none'";
const TYPES = {
  ".html": "text/html; charset=utf-8", ".js": "text/javascript", ".css": "text/css",
  ".svg": "image/svg+xml",
};
const HOME = [40.4434, -3.7382];
const LEGS = [[40.4438, -3.7388], [40.4444, -3.7388], [40.4444, -3.7378], [40.4438, -3.7378]];
const START = Date.now() - 60_000;

const ago = (seconds) => new Date(Date.now() - seconds * 1000).toISOString();
const command = (command_id, command_type_id, parameters) => ({ command_id, command_type_id, parameters });
const COMMANDS = [
  command(1, 1, { latitude: HOME[0], longitude: HOME[1], altitude: 10 }),
  ...LEGS.map(([latitude, longitude], index) =>
    command(2 + index, 3, { latitude, longitude, altitude: 25, hold_time: 1 })),
  command(6, 4, { pitch_angle: -90, photo_count: 3, time_interval: 2 }),
  command(7, 7, { latitude: 40.4441, longitude: -3.7383, orbit_altitude: 20, radius: 15 }),
  command(8, 11, { landing: true }),
];

let stopped = null;
let session = null;
let alarms = [
  { id: 2, recorded_at: ago(260), vehicle_id: 2, alarm_type_id: 1, alarm_code_id: 5, description: "GPS receiver has no fix", acknowledged_at: null },
  { id: 1, recorded_at: ago(90_000), vehicle_id: 1, alarm_type_id: 1, alarm_code_id: 3, description: "Vibration above the limit", acknowledged_at: ago(80_000) },
];
const events = [];
const drafts = [];

function place() {
  const seconds = (Date.now() - START) / 1000;
  const leg = Math.floor(seconds / 20) % LEGS.length;
  const part = (seconds % 20) / 20;
  const [from, to] = [LEGS[leg], LEGS[(leg + 1) % LEGS.length]];
  return [0, 1].map((axis) => from[axis] + (to[axis] - from[axis]) * part);
}

function vehicles() {
  const [latitude, longitude] = place();
  const base = { brokers: ["edge"], registered_at: ago(9e5), held: null, autopilot: "px4" };
  const flying = !stopped || Date.now() - stopped < 6000;
  return [
    { ...base, vehicle_id: 1, link_state: "connected", armed: flying, mode: "AUTO_MISSION", latitude, longitude,
      altitude: flying ? 25 : 0, battery_percentage: 0.68, mission_id: flying ? 11 : null, updated_at: ago(0), recorded_at: ago(0) },
    { ...base, vehicle_id: 2, link_state: "connected", armed: false, mode: "HOLD", latitude: 40.44325, longitude: -3.7386,
      altitude: 0, battery_percentage: 0.21, mission_id: null, updated_at: ago(3), recorded_at: ago(3),
      warning: "it is received but does not answer, so that orders may not reach it: the link may work in one direction only, or the vehicle has another signing key",
      held: { reason: "mission 9 failed: motor 3 stopped.", since: ago(900), mission_id: 9, plan_id: null } },
  ];
}

function plans() {
  const done = Math.min(6, 1 + Math.floor((Date.now() - START) / 20_000));
  const status = (index) => (stopped ? 5 : index < done ? 3 : index === done ? 2 : 1);
  const plan = (id, name, state, status_id, commands, vehicle_id = 1) => ({
    id, plan_id: `01HX0000000000000000000${String(id).padStart(3, "0")}`, name, received_at: ago(4000 - id * 900),
    expires_at: ago(-40_000), plan_status_id: status_id, plan_status_name: "", warnings: [],
    missions: [{ mission_id: 10 + id, vehicle_id, maximum_speed: 5, dispatch_state: state, mission_status_id: status_id, command_array: commands }],
  });
  const all = (value) => COMMANDS.map((one) => ({ ...one, command_status_id: value }));
  return [
    plan(0 + 3, "Pictures of the south field", "closed", 3, all(3)),
    plan(1, "Round over the north field", "accepted", stopped ? 5 : 2,
      COMMANDS.map((one, index) => ({ ...one, command_status_id: status(index) }))),
    plan(2, "Evening inspection", "held", 1, all(1), 2),
    ...drafts,
  ].sort((one, other) => one.id - other.id);
}

const mission = () => plans().filter((one) => one.id === 1).map((one) => ({ plan_id: one.plan_id, ...one.missions[0] }))[0];
const uplink = () => ({ state: Math.floor(Date.now() / 30_000) % 2 === 0 ? "open" : "blocked", records_waiting: 12 });
const snapshot = () => ({ vehicles: vehicles(), missions: [mission()], uplink: uplink() });
const FIELD = {
  id: 1, name: "North field", boundary: [[40.4436, -3.7392], [40.4447, -3.7392], [40.4447, -3.7374], [40.4436, -3.7374]],
  holes: [], exclusions: [[[40.44405, -3.73835], [40.44425, -3.73835], [40.44425, -3.73805]]], area_m2: 18600, received_at: ago(9e5), updated_at: ago(9e5),
};
const flight = (id) => ({ id, vehicle_id: 1, mission_id: 11, plan_id: null, started_at: ago(id * 8000), ended_at: ago(id * 8000 - 660), mission_status_id: id === 2 ? 5 : 3, distance_m: 1240, pictures: id === 1 ? 6 : 0, alarms: id === 2 ? 1 : 0,
  command_array: [1, 2, 3].map((number) => ({ command_id: number, command_status_id: 3, message: null, started_at: ago(id * 8000 - 100 * number), ended_at: ago(id * 8000 - 100 * number - 90) })) });
// A flight over ten legs of one minute: climbs, crosses the field, lands
const PATH = [[...HOME, 0], [...HOME, 25], ...LEGS.map((leg) => [...leg, 25]), ...LEGS.map((leg) => [...leg, 15]), [...HOME, 15], [...HOME, 0]];
const flown = () => Array.from({ length: (PATH.length - 1) * 60 + 1 }, (_, second) => {
  const leg = Math.min(Math.floor(second / 60), PATH.length - 2);
  const part = second / 60 - leg;
  const [latitude, longitude, altitude] = PATH[leg].map((from, axis) => from + (PATH[leg + 1][axis] - from) * part);
  return { latitude, longitude, altitude, speed: leg === 0 ? 0.4 : 3 + 2 * Math.sin(second / 20), at: ago(8000 - second) };
});
const observations = () => flown().filter((_, second) => second % 20 === 10).map((one, index) => ({
  id: index + 1, vehicle_id: 1, recorded_at: one.at, latitude: one.latitude, longitude: one.longitude, altitude: one.altitude,
  observation_array: [["air_temperature", 21 + 3 * Math.sin(index / 5), "Cel"], ["relative_humidity", 48 + index / 3, "%"], ["soil_moisture", 18 + 6 * Math.cos(index / 4), "%"], ["illuminance", 40000 + 900 * index, "lx"], ["wind_speed", 3 + Math.sin(index), "m/s"]]
    .map(([observed_property, result_value, result_uom]) => ({ resource_id: `urn:fixture:${observed_property}`, observed_property, result_time: Date.parse(one.at) / 1000, result_value, result_uom })),
}));
const pictures = () => flown().filter((_, second) => second % 110 === 80).map((one, index) => ({
  id: index + 1, recorded_at: one.at, latitude: one.latitude, longitude: one.longitude, altitude: one.altitude,
  url: `data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 4 3'><rect width='4' height='3' fill='hsl(${90 + 9 * index},40%25,40%25)'/></svg>`, thumbnail_url: null,
}));
const track = () => ({
  type: "Feature",
  properties: { coordinateProperties: { times: flown().map((one) => one.at), speeds: flown().map((one) => one.speed) } },
  geometry: { type: "LineString", coordinates: flown().map((one) => [one.longitude, one.latitude, one.altitude]) },
});
const problem = (message, detail = {}) => ({ message, detail });

const ROUTES = [
  ["GET", /^\/vehicles\/$/, () => [200, vehicles()]],
  ["POST", /^\/vehicles\/\d+\/release$/, () => [200, { ...vehicles()[1], held: null }]],
  ["GET", /^\/plans\/$/, () => [200, plans()]],
  ["GET", /^\/plans\/(\d+)$/, (id) => [200, plans().find((one) => one.id === Number(id))]],
  ["POST", /^\/plans\//, (_id, body) => {
    const list = body?.missions?.[0]?.command_array;
    if (list && list[0]?.command_type_id !== 1) {
      return [422, problem("the document cannot be used", { json: { "missions.0.command_array.0.command_type_id": ["the first command that moves the vehicle must be NAV_TAKEOFF"] } })];
    }
    return [201, plans()[1]];
  }],
  ["GET", /^\/fields\/$/, () => [200, [FIELD]]],
  ["GET", /^\/fields\/(\d+)$/, () => [200, FIELD]],
  ["POST", /^\/events\/$/, (_id, body) => {
    if (body.vehicle_id === 2) return [409, problem("vehicle 2 has no mission to interrupt")];
    stopped = Date.now();
    events.push({ id: events.length + 1, ...body, at: Date.now() });
    return [201, { ...events.at(-1), state: "queued" }];
  }],
  ["GET", /^\/events\/(\d+)$/, (id) => {
    const age = Date.now() - events[id - 1].at;
    return [200, { ...events[id - 1], state: age > 4000 ? "done" : age > 1200 ? "accepted" : "queued" }];
  }],
  ["GET", /^\/flights\/$/, () => [200, [1, 2, 3].map(flight)]],
  ["GET", /^\/flights\/(\d+)$/, (id) => [200, flight(Number(id))]],
  ["GET", /^\/flights\/\d+\/track$/, () => [200, track()]],
  ["GET", /^\/flights\/(\d+)\/observations$/, (id) => [200, id === "1" ? observations() : []]],
  ["GET", /^\/flights\/(\d+)\/pictures$/, (id) => [200, id === "1" ? pictures() : []]],
  ["GET", /^\/alarms\/history\/$/, () => [200, alarms]],
  ["POST", /^\/alarms\/history\/(\d+)\/acknowledge$/, (id) => {
    alarms = alarms.map((one) => (one.id === Number(id) ? { ...one, acknowledged_at: ago(0) } : one));
    return [200, alarms.find((one) => one.id === Number(id))];
  }],
  ["GET", /^\/users\/$/, () => [200, [{ name: "admin", role: "admin", created_at: ago(9e6), last_sign_in_at: ago(60), disabled: false }, { name: "maria", role: "operator", created_at: ago(8e6), last_sign_in_at: null, disabled: true }]]],
  ["GET", /^\/keys\/$/, () => [200, [{ prefix: "a1b2c3d4", name: "north-broker", role: "broker", scopes: [], vehicle_ids: null, state: "active", created_at: ago(9e6), expires_at: null, revoked_at: null }]]],
  ["GET", /^\/dead_letters\/$/, () => [200, []]],
];

function signIn(body) {
  if (body.link === undefined && body.name === "busy") return [429, problem("too many attempts"), { "Retry-After": "30" }];
  if (body.link === undefined && body.password !== "farm") return [401, problem("wrong name or password")];
  const name = body.name ?? "admin";
  session = { name, role: name === "admin" ? "admin" : "operator", csrf_token: "fixture", expires_at: ago(-40_000) };
  return [201, session];
}

async function file(path) {
  const name = normalize(path.slice("/console/".length)) || "index.html";
  const found = extname(name) ? name : "index.html";
  return [await readFile(join(DIST, found)), TYPES[extname(found)] ?? "application/octet-stream"];
}

function live(response) {
  let id = 0;
  const send = (type, data) => response.write(`id: ${(id += 1)}\nevent: ${type}\ndata: ${JSON.stringify(data)}\n\n`);
  response.writeHead(200, { "Content-Type": "text/event-stream" });
  send("snapshot", snapshot());
  alarms.forEach((one) => send("alarm", one));
  const timer = setInterval(() => {
    vehicles().forEach((one) => send("vehicle", one));
    if (id % 5 === 0) send("mission", mission());
    send("uplink", uplink());
  }, 1000);
  response.on("close", () => clearInterval(timer));
}

createServer(async (request, response) => {
  const { pathname } = new URL(request.url, "http://fixture");
  const chunks = [];
  for await (const chunk of request) chunks.push(chunk);
  const answer = (status, body, headers = {}) => {
    response.writeHead(status, { "Content-Type": "application/json", ...headers });
    response.end(status === 204 ? undefined : JSON.stringify(body));
  };
  try {
    if (pathname.startsWith("/console/")) {
      const [content, type] = await file(pathname);
      response.writeHead(200, { "Content-Type": type, "Content-Security-Policy": POLICY });
      return response.end(content);
    }
    let body = null;
    try {
      body = JSON.parse(Buffer.concat(chunks).toString() || "null");
    } catch { /* A mission file */ }
    if (pathname === "/session/") {
      if (request.method === "POST") return answer(...signIn(body));
      if (request.method === "DELETE") session = null;
      if (request.method === "DELETE") return answer(204);
      return session ? answer(200, session) : answer(401, problem("no session"));
    }
    if (!session) return answer(401, problem("no session"));
    if (request.method !== "GET" && request.headers["x-csrf-token"] !== "fixture") return answer(403, problem("no CSRF token"));
    if (pathname === "/live/") return live(response);
    if (pathname === "/audit") {
      return response.end([1, 2].map((id) => JSON.stringify({ id, recorded_at: ago(id * 300), name: "maria", role: "operator", action: "plans.create", object: "plans/3", result: "done" })).join("\n"));
    }
    for (const [method, pattern, handler] of ROUTES) {
      const found = pattern.exec(pathname);
      if (found && method === request.method) return answer(...handler(found[1], body));
    }
    return answer(404, problem("not found"));
  } catch (error) {
    return answer(404, problem(String(error)));
  }
}).listen(PORT, "127.0.0.1", () => console.log(`http://127.0.0.1:${PORT}/console/`));
