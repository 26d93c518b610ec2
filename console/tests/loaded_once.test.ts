import { expect, test } from "vitest";
import { LoadedOnce, NotLoadedError } from "../src/app/loaded_once";
import { preloadAll } from "../src/app/preload";
import { compared } from "../src/app/server_version";

/** Code that cannot be loaded the first `failures` times. */
function code(failures: number) {
  let loads = 0;
  const once = new LoadedOnce(() => {
    loads += 1;
    return loads <= failures ? Promise.reject(new TypeError("Failed to fetch")) : Promise.resolve(loads);
  });
  return { once, loads: () => loads };
}

test("code that could not be loaded is loaded again when somebody tries again", async () => {
  const { once, loads } = code(1);
  await expect(once.promise()).rejects.toBeInstanceOf(NotLoadedError);
  await expect(once.promise()).rejects.toBeInstanceOf(NotLoadedError);
  expect(loads()).toBe(1); // React asks at each rendering
  once.forgetFailure();
  await once.promise();
  once.forgetFailure();
  expect([await once.promise(), once.value, loads()]).toEqual([2, 2, 2]);
});

test("a failure ahead of need is not remembered, and ends the preloading", async () => {
  const [good, bad, last] = [code(0), code(1), code(0)];
  const parts = [good, bad, last].map(({ once }) => ({ preload: () => once.preload() }));
  const idle = () => Promise.resolve();
  await preloadAll(parts, idle, () => false);
  expect([good.loads(), bad.loads(), last.loads()]).toEqual([1, 1, 0]);
  await preloadAll(parts, idle, () => false);
  expect([good.loads(), bad.loads(), last.loads()]).toEqual([1, 2, 1]);
});

test("nothing is preloaded once the connection is lost", async () => {
  const part = code(0);
  await preloadAll([{ preload: () => part.once.preload() }], () => Promise.resolve(), () => true);
  expect(part.loads()).toBe(0);
});

test("a page of another build is an update of the server", () => {
  const page = (name: string) => `<head><script type="module" crossorigin src="/console/assets/${name}"></script></head>`;
  expect(compared(page("index-a1.js"), "/console/assets/index-a1.js")).toBe("same");
  expect(compared(page("index-b2.js"), "/console/assets/index-a1.js")).toBe("updated");
  expect(compared("<h1>The console is not built</h1>", "/console/assets/index-a1.js")).toBe("same");
});
