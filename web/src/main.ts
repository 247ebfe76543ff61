// The page of jostle view: what comes over the socket, put where it is seen.

import { Connection } from "./connection";
import { Feedback, GoalResult, JointState, ObjectStates, Plan, TaskRun } from "./messages";
import { element, PlaybackControls } from "./playback";
import { parseScene } from "./scene";
import { Strips } from "./strips";
import { World } from "./world";

const kMostEvents = 200;
const kTypes = new Set([
  "jostle_msgs/msg/Feedback",
  "jostle_msgs/msg/GoalResult",
  "jostle_msgs/msg/ObjectStates",
  "jostle_msgs/msg/Plan",
  "jostle_msgs/msg/TaskRun",
  "sensor_msgs/msg/JointState",
]);

let world: World | undefined;
try {
  world = new World(element("world"));
} catch (error) {
  const words = document.createElement("p");
  words.textContent = `The world cannot be drawn: ${String(error)}. Its objects are in the table.`;
  element("world").append(words);
}

const strips = new Strips(element("strips"), [
  { title: "cost of the best plan", unit: "" },
  { title: "rollouts", unit: "per second" },
  { title: "workers", unit: "" },
]);

let now = 0n; // ns since 1970, of what came last
let lastCount: { time: number; rollouts: number } | undefined;
let lastWords = { phase: "", trouble: "" };
let run = "";

function tell(text: string, bad = false): void {
  const item = document.createElement("li");
  const time = document.createElement("time");
  time.textContent = now ? new Date(Number(now / 1_000_000n)).toLocaleTimeString() : "";
  item.append(time, text);
  item.className = bad ? "bad" : "";
  const list = element("events");
  list.prepend(item);
  while (list.childElementCount > kMostEvents) list.lastElementChild?.remove();
}

function showPlaces(): void {
  const body = element<HTMLTableSectionElement>("objects");
  const places = world?.places() ?? [];
  while (body.rows.length > places.length) body.deleteRow(-1);
  places.forEach((place, i) => {
    const row = body.rows[i] ?? body.insertRow();
    [place.name, place.x.toFixed(4), place.y.toFixed(4), place.z.toFixed(4), place.yaw.toFixed(3)].forEach((text, j) => {
      (row.cells[j] ?? row.insertCell()).textContent = text;
    });
  });
}

function takeFeedback(feedback: Feedback): void {
  const { elapsed } = feedback;
  const rollouts = Number(feedback.rollouts);
  const before = lastCount;
  let rate: number | null = null;
  if (before && elapsed > before.time && rollouts >= before.rollouts) {
    rate = (rollouts - before.rollouts) / (elapsed - before.time);
  }
  lastCount = { time: elapsed, rollouts };
  const cost = Number.isFinite(feedback.cost) ? feedback.cost : null;
  // Between goals nothing counts.
  if (feedback.phase !== "idle") strips.add({ time: elapsed, values: [cost, rate, feedback.workers.filter(({ alive }) => alive).length] });
  element("phase").textContent = `${feedback.phase}, ${feedback.actions} actions, ${feedback.replans} plans, ` +
    `${(1000 * feedback.target_distance).toFixed(0)} mm to go`;
  if (feedback.trouble && feedback.trouble !== lastWords.trouble) tell(feedback.trouble, true);
  if (feedback.phase !== lastWords.phase) tell(feedback.phase);
  lastWords = { phase: feedback.phase, trouble: feedback.trouble };
}

function takeRun({ goal }: TaskRun): void {
  const scene = world?.build(goal.execution_scene, parseScene);
  if (scene) showPlaces();
  if (run === goal.goal_id) return;
  run = goal.goal_id;
  strips.clear();
  lastCount = undefined;
  tell(`goal ${goal.goal_id}, controller ${goal.controller}`);
}

function take(type: string, message: unknown): void {
  switch (type) {
    case "jostle_msgs/msg/TaskRun":
      return takeRun(message as TaskRun);
    case "jostle_msgs/msg/ObjectStates":
      world?.move(message as ObjectStates);
      return showPlaces();
    case "sensor_msgs/msg/JointState": {
      const { name, position } = message as JointState;
      return world?.moveJoints(name, position);
    }
    case "jostle_msgs/msg/Plan": {
      const plan = message as Plan;
      world?.show(plan);
      return tell(`plan ${plan.number}: cost ${plan.cost.toPrecision(4)}${plan.at_goal ? ", reaches the goal" : ""}`);
    }
    case "jostle_msgs/msg/Feedback":
      return takeFeedback(message as Feedback);
    case "jostle_msgs/msg/GoalResult": {
      const result = message as GoalResult;
      return tell(`${result.success ? "done" : "ended"}: ${result.reason} ${result.error}`.trim(), !result.success);
    }
  }
}

const url = new URL(location.href);
url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
url.pathname = "/";
url.hash = "";
const connection = new Connection(url.href, kTypes, {
  onState(state) {
    const shown = element("state");
    shown.textContent = state;
    shown.className = state;
  },
  onInfo({ name, hasPlayback, hasControl }) {
    element("source").textContent = name;
    playback.show(hasPlayback);
    element("cancel").hidden = !hasControl;
  },
  onMessage(_topic, type, message, time) {
    now = time;
    take(type, message);
  },
  onTime(time) {
    now = time;
  },
  onParameters: (values) => playback.take(values),
  onStatus: (text) => tell(text, true),
});
const playback = new PlaybackControls((name, value) => connection.set(name, value));
element("cancel").addEventListener("click", () => connection.set("task.cancel", true));

addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const field = event.target instanceof HTMLElement ? event.target.tagName : "";
  if (field === "SELECT" || (field === "INPUT" && event.key.startsWith("Arrow"))) return;
  const help = element<HTMLDialogElement>("help");
  if (event.key === "?") help.open ? help.close() : help.showModal();
  else if (event.key === "v") world?.look();
  else if (field === "BUTTON" && event.key === " ") return; // it is pressed
  else if (!playback.press(event)) return;
  event.preventDefault();
});
