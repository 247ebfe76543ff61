// A page in Chromium, by its DevTools protocol.

import assert from "node:assert/strict";
import { join } from "node:path";

import { load, start } from "./programs.mjs";

const { WebSocket } = await load("ws");

/** Opens one page; the browser keeps what it must in `folder`. */
export async function browse(url, folder) {
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
