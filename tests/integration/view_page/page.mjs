// The page in Chromium: a recorded run is seen, and its objects move. JOSTLE_SCREENSHOT names a file for a picture.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";

import { endAll, load, record, serve, start } from "./programs.mjs";

const kSlowest = 0.1; // of the rates that the page offers

const { WebSocket } = await load("ws");
const folder = mkdtempSync(join(tmpdir(), "jostle-page-"));
after(async () => {
  await endAll();
  rmSync(folder, { recursive: true, force: true, maxRetries: 5 });
});

/** Chromium by its DevTools protocol: one page. */
async function browse(url) {
  const args = ["--headless=new", "--no-sandbox", "--disable-gpu-sandbox", "--enable-unsafe-swiftshader",
    "--use-angle=swiftshader", "--remote-debugging-port=0", `--user-data-dir=${join(folder, "profile")}`,
    "--window-size=1280,800", "about:blank"];
  const { child, match, ended } = await start(process.env.JOSTLE_CHROMIUM, args, /ws:\/\/\S+/);
  const origin = new URL(match[0]).host;
  const targets = await (await fetch(`http://${origin}/json`)).json();
  const socket = new WebSocket(targets.find(({ type }) => type === "page").webSocketDebuggerUrl);
  await new Promise((resolve) => socket.once("open", resolve));
  const waiting = new Map();
  const errors = [];
  socket.on("message", (data) => {
    const { id, method, params, result, error } = JSON.parse(data);
    if (method === "Runtime.exceptionThrown") errors.push(params.exceptionDetails.exception?.description);
    if (method === "Log.entryAdded" && params.entry.level === "error") errors.push(params.entry.text);
    waiting.get(id)?.(error ? Promise.reject(new Error(error.message)) : result);
  });
  let count = 0;
  const call = (method, params = {}) =>
    new Promise((resolve) => {
      waiting.set(++count, resolve);
      socket.send(JSON.stringify({ id: count, method, params }));
    });
  for (const domain of ["Runtime", "Log", "Page"]) await call(`${domain}.enable`);
  await call("Page.navigate", { url });
  const evaluate = async (expression) => {
    const { result, exceptionDetails } = await call("Runtime.evaluate", { expression, returnByValue: true, awaitPromise: true });
    assert.equal(exceptionDetails, undefined, expression);
    return result.value;
  };
  /** Waits until an expression is true in the page. */
  const until = async (expression) => {
    while (!(await evaluate(`Boolean(${expression})`))) await evaluate("new Promise(requestAnimationFrame)");
  };
  const close = async () => (socket.close(), child.kill(), await ended);
  return { call, evaluate, until, errors, close };
}

test("a recorded run is seen, and its objects move", async () => {
  const { bag, code } = await record(folder);
  assert.ok([0, 1].includes(code), `jostle run ended with ${code}`);
  const { url, stop } = await serve(bag);
  const page = await browse(url);
  await page.until(`document.readyState === "complete" && document.getElementById("state").textContent === "connected"`);
  const press = (key) => page.evaluate(`void dispatchEvent(new KeyboardEvent("keydown", {key: ${JSON.stringify(key)}}))`);
  const target = `[...document.querySelectorAll("#objects tr")].find((row) => row.cells[0].textContent === "target")`;
  const place = async () => (await page.evaluate(`${target}.innerText.split(/\\s+/).slice(1, 3)`)).map(Number);

  await page.until(`!document.getElementById("playback").hidden && Number(document.getElementById("place").max) > 0`);
  const isAt = ([x]) => `(${target} && ${target}.cells[1].textContent === "${x.toFixed(4)}")`;
  const setRate = (rate) =>
    `{ const list = document.getElementById("rate"); list.value = "${rate}"; list.dispatchEvent(new Event("change")); }`;

  // Played from its beginning, the target goes somewhere. Slowly, for a busy machine may draw once a second.
  await page.evaluate(setRate(kSlowest));
  await press(" ");
  await page.until(target);
  const begin = await place();
  await page.evaluate(setRate(50));
  await page.until(`document.getElementById("play").textContent === "play" && !${isAt(begin)}`);
  await page.until(`document.getElementById("events").innerText.includes("plan")`);
  const end = await place();
  assert.ok(Math.hypot(end[0] - begin[0], end[1] - begin[1]) > 0.05, `target went from ${begin} to ${end}`);

  // The slider shows the state of its moment.
  await page.evaluate(setRate(kSlowest));
  await press("Home");
  await press(" ");
  await page.until(`${target} && !${isAt(end)}`);
  await press("End");
  await page.until(isAt(end));
  assert.ok((await page.evaluate(`document.querySelector("#world canvas").width`)) > 300);
  assert.deepEqual(page.errors, []);
  if (process.env.JOSTLE_SCREENSHOT) {
    await page.evaluate(setRate(0.5));
    await press("Home");
    await press(" ");
    await page.until(`Number(document.getElementById("place").value) > 0.6 * Number(document.getElementById("place").max)`);
    await press(" ");
    await page.evaluate("new Promise((done) => setTimeout(done, 1000))");
    const { data } = await page.call("Page.captureScreenshot", { format: "png" });
    writeFileSync(process.env.JOSTLE_SCREENSHOT, Buffer.from(data, "base64"));
  }
  await page.close();
  assert.equal(await stop(), 0);
});
