import { expect, test } from "vitest";
import { EventParser } from "../src/live/event_stream";

test("an event that arrives in pieces is given once, when it is complete", () => {
  const parser = new EventParser();
  expect(parser.push('id: 7\nevent: veh')).toEqual([]);
  expect(parser.push('icle\ndata: {"a":1}\n')).toEqual([]);
  expect(parser.push("\n")).toEqual([{ type: "vehicle", data: '{"a":1}', id: "7" }]);
});

test("a comment is a heartbeat and carries no id", () => {
  expect(new EventParser().push(": still here\n")).toEqual([
    { type: "heartbeat", data: "", id: null },
  ]);
});

test("data of several lines is joined", () => {
  const [event] = new EventParser().push("data: one\ndata: two\r\n\r\n");
  expect(event?.data).toBe("one\ntwo");
});

test("a line end that is split between two pieces is one line end", () => {
  const parser = new EventParser();
  expect(parser.push("data: one\r")).toEqual([]);
  expect(parser.push("\n\r\n")).toEqual([{ type: "message", data: "one", id: null }]);
});
