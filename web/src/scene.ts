// Scenes of format 2 as text, as goals carry them: scenes/README.md documents them, models/README.md the robot's part.

import { parse } from "yaml";

export interface ScenePose {
  position?: [number, number, number]; // m
  orientation?: [number, number, number, number]; // w, x, y, z
}

export interface SceneShape {
  name: string;
  shape: "box" | "cylinder" | "sphere" | "mesh";
  size?: [number, number, number]; // full extents, m
  radius?: number; // m
  height?: number; // m
  vertices?: number[]; // [n][3], m
  pose?: ScenePose;
  material?: string;
}

export interface SceneObject extends Omit<SceneShape, "pose"> {
  pose: { x: number; y: number; yaw: number };
}

export interface SceneJoint {
  name: string;
  kind: "slide" | "hinge";
  axis: [number, number, number];
}

export interface SceneLink {
  name: string;
  parent?: string;
  pose?: ScenePose;
  joints?: SceneJoint[];
  geoms?: SceneShape[];
}

export interface Disc {
  x: number;
  y: number;
  radius: number;
}

export interface Scene {
  name: string;
  surface: { parts: { x: number; y: number; size: [number, number] }[] };
  fixtures?: SceneShape[];
  robot: { model: { name: string; links: SceneLink[] }; base?: ScenePose; start?: Record<string, number> };
  objects: SceneObject[];
  task: { kind: string; target: string; goal?: Disc; obstacle?: Disc };
}

export function parseScene(text: string): Scene {
  return parse(text) as Scene;
}

/** Names of the robot's joints, in the order of a state. */
export function jointNames(scene: Scene): string[] {
  return scene.robot.model.links.flatMap((link) => (link.joints ?? []).map((joint) => joint.name));
}
