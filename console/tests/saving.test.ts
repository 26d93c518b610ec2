import { expect, test } from "vitest";
import { Fault, RequestError, type Tagged } from "../src/api/client";
import { Attempts, ChangedError, save } from "../src/planning/saving";

/** A resource at an edge server: content, a live status that changes its tag, and several writers. */
class Resource {
  content: string | null = "first";
  status = 0;
  writes = 0;
  losesAnswers = false;
  last = { by: "ana", at: "2026-05-01T08:00:00Z" };

  read = async (): Promise<Tagged<string>> => {
    if (this.content === null) throw new RequestError(404, "not found");
    return { value: this.content, tag: `${this.content}/${this.status}` };
  };
  put = (content: string) => async (tag: string): Promise<string> => {
    const { tag: present } = await this.read();
    if (tag !== present) throw new RequestError(412, "changed", [], null, this.last);
    this.content = content;
    this.writes += 1;
    if (this.losesAnswers) throw new RequestError(0, "unreachable");
    return content;
  };
}

const over = (there: Resource, base: Tagged<string>, mine: string) => save(base, {
  put: there.put(mine), read: there.read,
  isSame: (one, other) => one === other, isMine: (theirs) => theirs === mine,
});

test("of two people who edit one version, the second learns what the first has made of it", async () => {
  const there = new Resource();
  const [ana, juan] = [await there.read(), await there.read()];
  expect(await over(there, ana, "Ana's")).toBe("Ana's");
  const failure = await over(there, juan, "Juan's").catch((reason: unknown) => reason);
  expect(failure).toBeInstanceOf(ChangedError);
  expect((failure as ChangedError<string>).theirs?.value).toBe("Ana's");
  expect((failure as ChangedError<string>).last?.by).toBe("ana");
  expect(there.content).toBe("Ana's");
});

test("who has loaded the other version can save over it", async () => {
  const there = new Resource();
  const base = await there.read();
  await over(there, base, "Ana's");
  const failure = await over(there, base, "Juan's").catch((reason: unknown) => reason as ChangedError<string>);
  const { theirs } = failure as ChangedError<string>;
  expect(theirs && await over(there, theirs, "both")).toBe("both");
});

test("a live status that has changed is no reason to ask", async () => {
  const there = new Resource();
  const base = await there.read();
  there.status = 1;
  expect(await over(there, base, "mine")).toBe("mine");
});

test("what was saved before its answer was lost is not a version of somebody else", async () => {
  const there = new Resource();
  const base = await there.read();
  there.losesAnswers = true;
  await expect(over(there, base, "mine")).rejects.toMatchObject({ status: 0 });
  there.losesAnswers = false;
  expect(await over(there, base, "mine")).toBe("mine");
  expect(there.writes).toBe(1);
});

test("a version that was deleted is not made again", async () => {
  const there = new Resource();
  const base = await there.read();
  there.content = null;
  const failure = await over(there, base, "mine").catch((reason: unknown) => reason);
  expect((failure as ChangedError<string>).theirs).toBeNull();
  expect(there.content).toBeNull();
});

test("a refusal for another reason stays what it is", async () => {
  const refused = new RequestError(422, "wrong", [new Fault("name", "is too long")]);
  const work = save({ value: "a", tag: "a" }, {
    put: () => Promise.reject(refused), read: () => Promise.reject(refused),
    isSame: () => true, isMine: () => false,
  });
  await expect(work).rejects.toBe(refused);
});

test("the same content again is the same document under the same key", async () => {
  const attempts = new Attempts();
  const sent: [number, string][] = [];
  const send = (document: number, key: string) => {
    sent.push([document, key]);
    return Promise.reject(new RequestError(0, "unreachable"));
  };
  await attempts.run({ name: "North" }, 1, send).catch(() => undefined);
  await attempts.run({ name: "North" }, 2, send).catch(() => undefined);
  await attempts.run({ name: "South" }, 3, send).catch(() => undefined);
  expect(sent.map(([document]) => document)).toEqual([1, 1, 3]);
  expect(sent[0]?.[1]).toBe(sent[1]?.[1]);
  expect(new Set(sent.map(([, key]) => key)).size).toBe(2);
  expect(sent[0]?.[1]).toMatch(/^[0-9a-f]{32}$/);
});
