// Foxglove's own client, from npm, with jostle view on a recorded run.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";

import { endAll, load, record, serve } from "./programs.mjs";

const { FoxgloveClient } = await load("@foxglove/ws-protocol");
const { parse } = await load("@foxglove/rosmsg");
const { MessageReader } = await load("@foxglove/rosmsg2-serialization");
const { WebSocket } = await load("ws");

const folder = mkdtempSync(join(tmpdir(), "jostle-view-"));
after(async () => {
  await endAll();
  rmSync(folder, { recursive: true });
});

function connect(url) {
  const client = new FoxgloveClient({
    ws: new WebSocket(url.replace("http", "ws"), [FoxgloveClient.SUPPORTED_SUBPROTOCOL]),
  });
  client.on("error", (error) => assert.fail(error));
  return client;
}

const heard = (client, event, wanted = () => true) =>
  new Promise((resolve) => client.on(event, (value) => wanted(value) && resolve(value)));

test("the official client lists channels, subscribes, decodes, and seeks in a bag", async () => {
  const { bag, code } = await record(folder);
  assert.ok([0, 1].includes(code), `jostle run ended with ${code}`); // whether the push succeeds is not the matter here
  const { url, stop } = await serve(bag);
  const client = connect(url);
  const channels = new Map();
  client.on("advertise", (list) => list.forEach((channel) => channels.set(channel.topic, channel)));
  const info = await heard(client, "serverInfo");
  assert.deepEqual(info.capabilities, ["time", "parameters", "parametersSubscribe"]);
  client.getParameters([], "all");
  const { parameters } = await heard(client, "parameterValues", ({ id }) => id === "all");
  const value = (list, name) => list.find((one) => one.name === name).value;
  const length = value(parameters, "playback.length");
  assert.ok(length > 0);

  // Every schema can be parsed, and every channel is CDR.
  for (const topic of ["/objects/states", "/joint_states", "/task/run", "/task/plan", "/task/feedback", "/tf"]) {
    const channel = channels.get(topic);
    assert.ok(channel, `${topic} is not among ${[...channels.keys()]}`);
    assert.equal(channel.encoding, "cdr");
    assert.equal(channel.schemaEncoding, "ros2msg");
    parse(channel.schema, { ros2: true });
  }
  const channel = channels.get("/objects/states");
  const reader = new MessageReader(parse(channel.schema, { ros2: true }));
  const id = client.subscribe(channel.id);
  const stateAt = async (time) => {
    const state = heard(client, "message", ({ subscriptionId }) => subscriptionId === id);
    client.setParameters([{ name: "playback.time", value: time }], "seek");
    const answer = await heard(client, "parameterValues", (event) => event.id === "seek");
    assert.ok(Math.abs(value(answer.parameters, "playback.time") - time) < 1e-8); // ns, and doubles
    const message = await state;
    return { time: message.timestamp, objects: reader.readMessage(message.data).objects };
  };
  const last = await stateAt(length);
  const early = await stateAt(length / 2);
  const again = await stateAt(length);
  assert.ok(early.time < last.time);
  assert.deepEqual(again, last);
  assert.ok(last.objects.length > 0);
  assert.ok(last.objects.every(({ name, pose }) => name && Number.isFinite(pose.position.x)));
  client.close();
  assert.equal(await stop(), 0);
});
