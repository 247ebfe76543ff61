// Our programs as a user starts them, and npm's libraries from where they were installed.

import { spawn } from "node:child_process";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const kFirstDomain = 200; // above those that tests in C++ take

const modules = createRequire(process.env.JOSTLE_NODE_MODULES);

export async function load(name) {
  const module = await import(pathToFileURL(modules.resolve(name)).href);
  return { ...module.default, ...module };
}

const running = new Map(); // their ends, by process

/** Ends whatever a test that failed has left. */
export async function endAll() {
  for (const child of running.keys()) child.kill("SIGKILL");
  await Promise.all(running.values());
}

/** Starts a program; `ready` is a pattern of its standard error. Returns the process, what matched, and its end. */
export async function start(program, args, ready, environment = {}) {
  const child = spawn(program, args, { env: { ...process.env, ...environment }, stdio: ["ignore", "ignore", "pipe"] });
  const ended = new Promise((resolve) => child.on("exit", (code, signal) => resolve(code ?? signal)));
  running.set(child, ended);
  ended.then(() => running.delete(child));
  let said = "";
  const match = await new Promise((resolve, reject) => {
    child.on("error", reject);
    child.stderr.on("data", (data) => {
      said += data;
      const found = said.match(ready);
      if (found) resolve(found);
    });
    ended.then((code) => reject(new Error(`${program} ended with ${code}:\n${said}`)));
  });
  return { child, match, ended };
}

export const ours = (name) => join(process.env.JOSTLE_PROGRAMS, name);

const kPush = join(process.env.JOSTLE_SOURCE_DIR, "scenes/push-obstacle.yaml");

/** A run, recorded, of the pusher unless told; the folder of its bag. */
export async function record(folder, scene = kPush, options = ["--predictor", "coarse,learned"]) {
  const bag = join(folder, "bag");
  const args = [scene, "--pool", "threads", "--workers", "2", ...options, "--headless", "--record", bag];
  const domain = String(kFirstDomain + (process.pid % 30));
  const { ended } = await start(ours("jostle_run"), args, /./, { TMPDIR: folder, ROS_DOMAIN_ID: domain });
  return { bag, code: await ended };
}

/** Serves a bag; the page's address. */
export async function serve(bag) {
  const { child, match, ended } = await start(ours("jostle_view"), [bag, "--paused", "--port", "0"], /http:\S+/);
  return { url: match[0], stop: () => (child.kill("SIGINT"), ended) };
}
