// The server's socket: channels, decoded samples, time and parameters; again and again until it is there.

import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { Channel, FoxgloveClient, Parameter } from "@foxglove/ws-protocol";

export interface Listener {
  onState(state: "connecting" | "connected" | "closed"): void;
  onInfo(info: { name: string; hasPlayback: boolean; hasControl: boolean }): void;
  /** `time`: ns since 1970, when the sample was recorded or came. */
  onMessage(topic: string, type: string, message: unknown, time: bigint): void;
  onTime(time: bigint): void;
  onParameters(values: Map<string, unknown>): void;
  onStatus(text: string): void;
}

const kRetry = 1000; // ms

export class Connection {
  #client: FoxgloveClient | undefined;
  #readers = new Map<number, { channel: Channel; reader: MessageReader }>(); // by subscription

  /** `types`: of topics that are subscribed to, such as "jostle_msgs/msg/Plan". */
  constructor(
    private readonly url: string,
    private readonly types: Set<string>,
    private readonly listener: Listener,
  ) {
    this.#open();
  }

  set(name: string, value: number | boolean): void {
    this.#client?.setParameters([{ name, value } as Parameter], name);
  }

  #open(): void {
    this.listener.onState("connecting");
    this.#readers.clear();
    const socket = new WebSocket(this.url, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
    const client = new FoxgloveClient({ ws: socket });
    this.#client = client;
    client.on("open", () => this.listener.onState("connected"));
    client.on("close", () => {
      this.listener.onState("closed");
      setTimeout(() => this.#open(), kRetry);
    });
    client.on("error", () => {}); // "close" follows
    client.on("serverInfo", (info) => {
      const hasPlayback = info.capabilities.includes("time");
      const hasParameters = info.capabilities.includes("parameters");
      this.listener.onInfo({ name: info.name, hasPlayback, hasControl: hasParameters && !hasPlayback });
      if (hasParameters) client.subscribeParameterUpdates([]);
    });
    client.on("advertise", (channels) => channels.forEach((channel) => this.#subscribe(client, channel)));
    client.on("message", ({ subscriptionId, timestamp, data }) => {
      const found = this.#readers.get(subscriptionId);
      if (!found) return;
      this.listener.onMessage(found.channel.topic, found.channel.schemaName, found.reader.readMessage(data), timestamp);
    });
    client.on("time", ({ timestamp }) => this.listener.onTime(timestamp));
    client.on("parameterValues", ({ parameters }) =>
      this.listener.onParameters(new Map(parameters.map(({ name, value }) => [name, value]))),
    );
    client.on("status", ({ message }) => this.listener.onStatus(message));
  }

  #subscribe(client: FoxgloveClient, channel: Channel): void {
    if (!this.types.has(channel.schemaName) || channel.encoding !== "cdr") return;
    const reader = new MessageReader(parse(channel.schema, { ros2: true }));
    this.#readers.set(client.subscribe(channel.id), { channel, reader });
  }
}
