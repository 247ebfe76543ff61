// The page in Chromium: a recorded run is seen, and its objects move. JOSTLE_SCREENSHOT names a file for a picture.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";

import { browse } from "./browser.mjs";
import { endAll, record, serve } from "./programs.mjs";

const kSlowest = 0.1; // of the rates that the page offers

const folder = mkdtempSync(join(tmpdir(), "jostle-page-"));
after(async () => {
  await endAll();
  rmSync(folder, { recursive: true, force: true, maxRetries: 5 });
});

test("a recorded run is seen, and its objects move", async () => {
  const { bag, code } = await record(folder);
  assert.ok([0, 1].includes(code), `jostle run ended with ${code}`);
  const { url, stop } = await serve(bag);
  const page = await browse(url, folder);
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
