// Sends the request of a form on the page /docs and shows its answer. The browser adds the key that
// the page was opened with; a write of a person who is signed in carries the token of the session.
"use strict";

const csrfHeaders = async () => {
  const answer = await fetch("/session/", { headers: { Accept: "application/json" } });
  const token = answer.ok ? (await answer.json()).csrf_token : null;
  return token ? { "X-CSRF-Token": token } : {};
};

const requestOf = (form) => {
  let path = form.dataset.path;
  const query = new URLSearchParams();
  const headers = { Accept: "application/json, */*" };
  for (const input of form.querySelectorAll("input")) {
    if (input.dataset.in === "path") {
      path = path.replace(`{${input.name}}`, encodeURIComponent(input.value));
    } else if (input.value && input.dataset.in === "query") {
      query.append(input.name, input.value);
    } else if (input.value) {
      headers[input.name] = input.value;
    }
  }
  const body = form.querySelector("textarea")?.value;
  if (body) headers["Content-Type"] = "application/json";
  const url = query.size ? `${path}?${query}` : path;
  return { url, headers, body: body || undefined };
};

const shown = (text) => {
  try {
    return JSON.stringify(JSON.parse(text), null, 2);
  } catch {
    return text;
  }
};

document.addEventListener("submit", async (event) => {
  event.preventDefault();
  const form = event.target;
  const method = form.dataset.method;
  const output = form.querySelector("output");
  const { url, headers, body } = requestOf(form);
  if (method !== "GET" && !confirm(`${method} ${url} changes the farm. Send it?`)) return;
  output.textContent = "waiting for the answer";
  try {
    if (method !== "GET") Object.assign(headers, await csrfHeaders());
    const answer = await fetch(url, { method, headers, body });
    output.textContent = `${answer.status} ${answer.statusText}\n${shown(await answer.text())}`;
  } catch (error) {
    output.textContent = `no answer: ${error.message}`;
  }
});
