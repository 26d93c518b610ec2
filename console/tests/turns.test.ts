import { expect, test } from "vitest";
import { Turns } from "../src/flights/turns";

function taking(turns: Turns) {
  const begun: string[] = [];
  return { begun, take: (name: string) => turns.take(() => begun.push(name)) };
}

test("so many begin at once, the others in order as turns are given back", () => {
  const { begun, take } = taking(new Turns(2));
  const [first, second] = ["a", "b", "c", "d"].map(take);
  expect(begun).toEqual(["a", "b"]);
  second?.();
  expect(begun).toEqual(["a", "b", "c"]);
  first?.();
  expect(begun).toEqual(["a", "b", "c", "d"]);
});

test("a turn that is given back twice is one turn", () => {
  const { begun, take } = taking(new Turns(1));
  const end = take("a");
  end();
  end();
  take("b");
  take("c");
  expect(begun).toEqual(["a", "b"]);
});

test("who waits no more is passed over", () => {
  const { begun, take } = taking(new Turns(1));
  const [end, leave] = ["a", "b", "c"].map(take);
  leave?.();
  end?.();
  expect(begun).toEqual(["a", "c"]);
});
