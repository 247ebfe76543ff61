// The world in 3D. Metres, z up; whatever has moved is drawn with the next frame.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { ConvexGeometry } from "three/examples/jsm/geometries/ConvexGeometry.js";

import { ObjectStates, Plan } from "./messages";
import { Disc, jointNames, Scene, SceneJoint, ScenePose, SceneShape } from "./scene";

const kColors = {
  target: 0xd9482b,
  object: 0x4c7fb8,
  surface: { light: 0xe4ded2, dark: 0x3a3d42 },
  background: { light: 0xf7f7f5, dark: 0x17191c },
  fixture: 0x9a8f80,
  goal: 0x3a9d5d,
  obstacle: 0xc03a5b,
  path: { target: 0xd9482b, robot: 0x7b5bd6 },
};

const kRobotColors: Record<string, number> = { steel: 0x8d949c, dark: 0x3c4046, arm: 0x6fa0cf }; // by material

const kUnknownSize = 0.03; // m, of an object whose scene has not come

function place(node: THREE.Object3D, pose: ScenePose | undefined): void {
  const [x, y, z] = pose?.position ?? [0, 0, 0];
  const [qw, qx, qy, qz] = pose?.orientation ?? [1, 0, 0, 0];
  node.position.set(x, y, z);
  node.quaternion.set(qx, qy, qz, qw);
}

function geometryOf(shape: Omit<SceneShape, "pose">): THREE.BufferGeometry {
  if (shape.shape === "box") return new THREE.BoxGeometry(...(shape.size ?? [kUnknownSize, kUnknownSize, kUnknownSize]));
  if (shape.shape === "sphere") return new THREE.SphereGeometry(shape.radius, 24, 16);
  if (shape.shape === "mesh") {
    const values = shape.vertices ?? [];
    const points: THREE.Vector3[] = [];
    for (let i = 0; i + 2 < values.length; i += 3) points.push(new THREE.Vector3(values[i], values[i + 1], values[i + 2]));
    return new ConvexGeometry(points);
  }
  return new THREE.CylinderGeometry(shape.radius, shape.radius, shape.height, 40).rotateX(Math.PI / 2); // three's stand along y
}

function solid(shape: Omit<SceneShape, "pose">, color: number, opacity = 1): THREE.Mesh {
  const material = new THREE.MeshStandardMaterial({ color, roughness: 0.75, transparent: opacity < 1, opacity });
  return new THREE.Mesh(geometryOf(shape), material);
}

function label(text: string): THREE.Sprite {
  const canvas = document.createElement("canvas");
  const font = "500 36px system-ui, sans-serif";
  const pen = canvas.getContext("2d")!;
  pen.font = font;
  canvas.width = Math.ceil(pen.measureText(text).width) + 16;
  canvas.height = 48;
  pen.font = font;
  pen.textBaseline = "middle";
  pen.lineWidth = 6;
  pen.strokeStyle = "rgba(0, 0, 0, 0.65)";
  pen.strokeText(text, 8, 24);
  pen.fillStyle = "white";
  pen.fillText(text, 8, 24);
  const sprite = new THREE.Sprite(
    new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false, sizeAttenuation: false }),
  );
  const height = 0.035; // of the view's
  sprite.scale.set((height * canvas.width) / canvas.height, height, 1);
  return sprite;
}

function disc({ x, y, radius }: Disc, color: number): THREE.Mesh {
  const mesh = new THREE.Mesh(
    new THREE.RingGeometry(0.9 * radius, radius, 48),
    new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide }),
  );
  mesh.position.set(x, y, 0.001);
  return mesh;
}

// Frees what the graphics memory holds of a node and all below it.
function discard(node: THREE.Object3D): void {
  node.traverse((one) => {
    if (!(one instanceof THREE.Mesh || one instanceof THREE.Line || one instanceof THREE.Sprite)) return;
    one.geometry.dispose();
    const material = one.material as THREE.Material & { map?: THREE.Texture | null };
    material.map?.dispose();
    material.dispose();
  });
  node.removeFromParent();
}

// A robot's links hang on one another as its model says; every joint is a node of its own.
class Robot {
  readonly root = new THREE.Group();
  readonly #joints = new Map<string, { node: THREE.Group; joint: SceneJoint }>();
  #tool: THREE.Object3D = this.root;

  constructor(scene: Scene) {
    place(this.root, scene.robot.base);
    const links = new Map<string, THREE.Object3D>();
    for (const link of scene.robot.model.links) {
      let node: THREE.Group = new THREE.Group();
      place(node, link.pose);
      (links.get(link.parent ?? "") ?? this.root).add(node);
      for (const joint of link.joints ?? []) {
        const moved = new THREE.Group();
        node.add(moved);
        this.#joints.set(joint.name, { node: moved, joint });
        node = moved;
      }
      links.set(link.name, node);
      for (const geom of link.geoms ?? []) {
        const mesh = solid(geom, kRobotColors[geom.material ?? "steel"] ?? kColors.object);
        place(mesh, geom.pose);
        node.add(mesh);
      }
      if (this.#tool === this.root && link.geoms?.length) this.#tool = node;
    }
    for (const [name, value] of Object.entries(scene.robot.start ?? {})) this.set(name, value);
  }

  set(name: string, value: number): void {
    const found = this.#joints.get(name);
    if (!found) return;
    const axis = new THREE.Vector3(...found.joint.axis);
    if (found.joint.kind === "slide") found.node.position.copy(axis.multiplyScalar(value));
    else found.node.quaternion.setFromAxisAngle(axis, value);
  }

  get(name: string): number {
    const found = this.#joints.get(name);
    if (!found) return 0;
    const axis = new THREE.Vector3(...found.joint.axis);
    if (found.joint.kind === "slide") return found.node.position.dot(axis);
    const { x, y, z, w } = found.node.quaternion;
    return 2 * Math.atan2(new THREE.Vector3(x, y, z).dot(axis), w);
  }

  /** Where its first link with a surface is, in the world. */
  tool(): THREE.Vector3 {
    return this.#tool.getWorldPosition(new THREE.Vector3());
  }
}

export interface ObjectPlace {
  name: string;
  x: number; // m
  y: number;
  z: number;
  yaw: number; // rad
}

export class World {
  readonly #renderer: THREE.WebGLRenderer;
  readonly #scene = new THREE.Scene();
  readonly #camera = new THREE.PerspectiveCamera(40, 1, 0.01, 50);
  readonly #controls: OrbitControls;
  readonly #ground = new THREE.Group();
  readonly #path = new THREE.Group();
  readonly #objects = new Map<string, THREE.Group>();
  #robot: Robot | undefined;
  #described: Scene | undefined;
  #text = "";
  #dirty = true;

  /** Throws where the browser has no WebGL. */
  constructor(private readonly holder: HTMLElement) {
    this.#renderer = new THREE.WebGLRenderer({ antialias: true });
    holder.append(this.#renderer.domElement);
    this.#controls = new OrbitControls(this.#camera, this.#renderer.domElement);
    this.#controls.addEventListener("change", () => (this.#dirty = true));
    this.#camera.up.set(0, 0, 1);
    const sun = new THREE.DirectionalLight(0xffffff, 2.2);
    sun.position.set(-1, -2, 4);
    this.#scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8a8a, 1.6), sun, this.#ground, this.#path);
    this.look();
    new ResizeObserver(() => this.#resize()).observe(holder);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", () => this.#paint(dark.matches));
    this.#paint(dark.matches);
    const frame = () => {
      requestAnimationFrame(frame);
      this.#controls.update();
      if (!this.#dirty) return;
      this.#dirty = false;
      this.#renderer.render(this.#scene, this.#camera);
    };
    frame();
  }

  /** Looks at everything, from the robot's side. */
  look(): void {
    const box = new THREE.Box3();
    for (const part of this.#described?.surface.parts ?? [{ x: 0, y: 0, size: [0.6, 0.6] }]) {
      box.expandByPoint(new THREE.Vector3(part.x - part.size[0] / 2, part.y - part.size[1] / 2, 0));
      box.expandByPoint(new THREE.Vector3(part.x + part.size[0] / 2, part.y + part.size[1] / 2, 0));
    }
    const center = box.getCenter(new THREE.Vector3());
    const reach = box.getSize(new THREE.Vector3()).length();
    this.#controls.target.copy(center);
    this.#camera.position.set(center.x - 0.85 * reach, center.y - 0.35 * reach, 0.9 * reach);
    this.#dirty = true;
  }

  /** Builds the world of a goal; returns its scene, or nothing if it stands already. */
  build(text: string, parse: (text: string) => Scene): Scene | undefined {
    if (text === this.#text) return undefined;
    const scene = parse(text);
    this.#text = text;
    this.#described = scene;
    for (const child of [...this.#ground.children]) discard(child);
    for (const node of this.#objects.values()) discard(node);
    this.#objects.clear();
    if (this.#robot) discard(this.#robot.root);
    this.#clearPath();
    for (const part of scene.surface.parts) {
      const mesh = solid({ name: "", shape: "box", size: [part.size[0], part.size[1], 0.01] }, 0);
      mesh.position.set(part.x, part.y, -0.005);
      mesh.name = "surface";
      this.#ground.add(mesh);
    }
    for (const fixture of scene.fixtures ?? []) {
      const mesh = solid(fixture, kColors.fixture, 0.5);
      place(mesh, fixture.pose);
      this.#ground.add(mesh);
    }
    if (scene.task.goal) this.#ground.add(disc(scene.task.goal, kColors.goal));
    if (scene.task.obstacle) this.#ground.add(disc(scene.task.obstacle, kColors.obstacle));
    for (const object of scene.objects) {
      const height = object.shape === "cylinder" ? (object.height ?? 0) : (object.size?.[2] ?? 0);
      const node = this.#add(object.name, object, height);
      node.position.set(object.pose.x, object.pose.y, height / 2);
      node.rotation.z = object.pose.yaw;
    }
    this.#robot = new Robot(scene);
    this.#scene.add(this.#robot.root);
    this.#paint(matchMedia("(prefers-color-scheme: dark)").matches);
    this.look();
    return scene;
  }

  move({ objects }: ObjectStates): void {
    for (const { name, pose } of objects) {
      const unknown = { name, shape: "box" as const };
      const node = this.#objects.get(name) ?? this.#add(name, unknown, kUnknownSize);
      node.position.set(pose.position.x, pose.position.y, pose.position.z);
      node.quaternion.set(pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w);
    }
    this.#dirty = true;
  }

  moveJoints(names: string[], positions: Float64Array): void {
    names.forEach((name, i) => this.#robot?.set(name, positions[i] ?? 0));
    this.#dirty = true;
  }

  /** Draws where the plan takes the target, and the robot. */
  show(plan: Plan): void {
    this.#clearPath();
    const scene = this.#described;
    const nq = plan.q.length;
    if (!scene || !this.#robot || nq === 0) return;
    const joints = jointNames(scene);
    const target = joints.length + 7 * scene.objects.findIndex(({ name }) => name === scene.task.target);
    const steps = Math.floor(plan.states.length / nq);
    const now = joints.map((name) => this.#robot!.get(name));
    const ofTarget: THREE.Vector3[] = [];
    const ofRobot: THREE.Vector3[] = [];
    for (let i = 0; i < steps; ++i) {
      const q = plan.states.subarray(i * nq, (i + 1) * nq);
      ofTarget.push(new THREE.Vector3(q[target], q[target + 1], q[target + 2]));
      joints.forEach((name, j) => this.#robot!.set(name, q[j] ?? 0));
      ofRobot.push(this.#robot.tool());
    }
    joints.forEach((name, j) => this.#robot!.set(name, now[j]!));
    this.#draw(ofTarget, kColors.path.target);
    this.#draw(ofRobot, kColors.path.robot);
    this.#dirty = true;
  }

  places(): ObjectPlace[] {
    return [...this.#objects].map(([name, { position, rotation }]) => ({
      name,
      x: position.x,
      y: position.y,
      z: position.z,
      yaw: rotation.z,
    }));
  }

  #add(name: string, shape: Omit<SceneShape, "pose">, height: number): THREE.Group {
    const node = new THREE.Group();
    node.rotation.order = "ZYX"; // its z is the yaw
    const isTarget = name === (this.#described?.task.target ?? "target");
    const text = label(name);
    text.position.z = height / 2 + 0.01;
    node.add(solid(shape, isTarget ? kColors.target : kColors.object), text);
    this.#objects.set(name, node);
    this.#scene.add(node);
    return node;
  }

  #draw(points: THREE.Vector3[], color: number): void {
    if (points.length < 2) return;
    const curve = new THREE.CatmullRomCurve3(points, false, "centripetal");
    const still = curve.getLength() < 1e-4;
    if (still) return;
    const tube = new THREE.TubeGeometry(curve, 4 * points.length, 0.0025, 6);
    this.#path.add(new THREE.Mesh(tube, new THREE.MeshBasicMaterial({ color, depthTest: false, transparent: true })));
  }

  #clearPath(): void {
    for (const child of [...this.#path.children]) discard(child);
    this.#dirty = true;
  }

  #resize(): void {
    const { clientWidth: width, clientHeight: height } = this.holder;
    if (width === 0 || height === 0) return;
    this.#renderer.setPixelRatio(devicePixelRatio);
    this.#renderer.setSize(width, height);
    this.#camera.aspect = width / height;
    this.#camera.updateProjectionMatrix();
    this.#dirty = true;
  }

  #paint(dark: boolean): void {
    const shade = dark ? "dark" : "light";
    this.#scene.background = new THREE.Color(kColors.background[shade]);
    for (const child of this.#ground.children) {
      if (child.name !== "surface" || !(child instanceof THREE.Mesh)) continue;
      (child.material as THREE.MeshStandardMaterial).color.setHex(kColors.surface[shade]);
    }
    this.#dirty = true;
  }
}
