// How soon the page shows a bag of forty objects, and how many frames a second it draws while the bag plays.
// `cmake --build build --target measure-page` runs it; JOSTLE_MEASURED names a file for the numbers.

import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { browse } from "./browser.mjs";
import { endAll, ours, record, serve } from "./programs.mjs";

const kObjects = 40; // beside the target
const kLoads = 7;
const kSeconds = 5; // of drawing

const quantile = (values, share) => [...values].sort((a, b) => a - b)[Math.floor(share * (values.length - 1))];

/** Seconds since navigation when all objects stand in the table and have been drawn. */
const shown = (page) => page.evaluate(`(async () => {
  const frame = () => new Promise(requestAnimationFrame);
  while (document.querySelectorAll("#objects tr").length <= ${kObjects}) await frame();
  await frame();
  return performance.now() / 1e3;
})()`);

/** Times between frames, s. */
const frames = (page) => page.evaluate(`(async () => {
  const times = [performance.now()];
  while (times.at(-1) - times[0] < ${1e3 * kSeconds}) times.push(await new Promise(requestAnimationFrame));
  return times.slice(1).map((time, i) => (time - times[i]) / 1e3);
})()`);

const folder = mkdtempSync(join(tmpdir(), "jostle-page-"));
try {
  const scene = join(folder, "scene.yaml");
  execFileSync(ours("jostle_scene"), ["generate", "--objects", String(kObjects), "--seed", "1", "-o", scene]);
  const { bag } = await record(folder, scene, ["--timeout", "120"]);
  const { url, stop } = await serve(bag);
  const loads = [], between = [];
  for (let i = 0; i < kLoads; ++i) {
    const page = await browse(url, folder);
    loads.push(await shown(page));
    await page.evaluate(`void dispatchEvent(new KeyboardEvent("keydown", {key: "Home"}))`);
    await page.evaluate(`void dispatchEvent(new KeyboardEvent("keydown", {key: " "}))`);
    between.push(...(await frames(page)));
    await page.close();
  }
  await stop();
  const measured = {
    objects: kObjects + 1,
    loads,
    load_median: quantile(loads, 0.5),
    frames_per_second: between.length / between.reduce((sum, time) => sum + time, 0),
    frame_median: quantile(between, 0.5),
    frame_p95: quantile(between, 0.95),
  };
  const text = JSON.stringify(measured, null, 1);
  console.log(text);
  if (process.env.JOSTLE_MEASURED) writeFileSync(process.env.JOSTLE_MEASURED, text + "\n");
} finally {
  await endAll();
  rmSync(folder, { recursive: true, force: true, maxRetries: 5 });
}
