// A recording's clock: shown, and set by buttons, slider and keys.

export const kRates = [0.1, 0.25, 0.5, 1, 2, 5, 10, 50];

export class PlaybackControls {
  readonly #footer = element<HTMLElement>("playback");
  readonly #play = element<HTMLButtonElement>("play");
  readonly #place = element<HTMLInputElement>("place");
  readonly #clock = element<HTMLOutputElement>("clock");
  readonly #rate = element<HTMLSelectElement>("rate");
  readonly #loop = element<HTMLInputElement>("loop");
  #time = 0; // s
  #length = 0; // s
  #paused = true;
  #dragged = false;

  constructor(private readonly set: (name: string, value: number | boolean) => void) {
    for (const rate of kRates) this.#rate.add(new Option(`${rate}×`, String(rate)));
    this.#play.addEventListener("click", () => this.toggle());
    this.#rate.addEventListener("change", () => set("playback.rate", Number(this.#rate.value)));
    this.#loop.addEventListener("change", () => set("playback.loop", this.#loop.checked));
    this.#place.addEventListener("input", () => {
      this.#dragged = true;
      this.goTo(Number(this.#place.value));
    });
    this.#place.addEventListener("change", () => (this.#dragged = false));
  }

  show(visible: boolean): void {
    this.#footer.hidden = !visible;
  }

  take(values: Map<string, unknown>): void {
    const number = (name: string, before: number) => Number(values.get(name) ?? before);
    this.#length = number("playback.length", this.#length);
    this.#time = number("playback.time", this.#time);
    this.#paused = Boolean(values.get("playback.paused") ?? this.#paused);
    if (values.has("playback.loop")) this.#loop.checked = Boolean(values.get("playback.loop"));
    if (values.has("playback.rate")) this.#showRate(number("playback.rate", 1));
    this.#place.max = String(this.#length);
    if (!this.#dragged) this.#place.value = String(this.#time);
    this.#play.textContent = this.#paused ? "play" : "pause";
    this.#clock.value = `${this.#time.toFixed(1)} / ${this.#length.toFixed(1)} s`;
  }

  toggle(): void {
    this.set("playback.paused", !this.#paused);
  }

  goTo(time: number): void {
    this.#time = Math.min(Math.max(time, 0), this.#length);
    this.set("playback.time", this.#time);
  }

  /** Whether the key meant something. */
  press(event: KeyboardEvent): boolean {
    if (this.#footer.hidden) return false;
    const step = event.shiftKey ? 10 : 1; // s
    const actions: Record<string, () => void> = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.goTo(this.#time - step),
      ArrowRight: () => this.goTo(this.#time + step),
      Home: () => this.goTo(0),
      End: () => this.goTo(this.#length),
      "+": () => this.#changeRate(1),
      "-": () => this.#changeRate(-1),
    };
    actions[event.key]?.();
    return event.key in actions;
  }

  #changeRate(by: number): void {
    const index = Math.min(Math.max(this.#rate.selectedIndex + by, 0), this.#rate.options.length - 1);
    this.set("playback.rate", Number(this.#rate.options[index]!.value));
  }

  #showRate(rate: number): void {
    const text = String(rate);
    if (![...this.#rate.options].some(({ value }) => value === text)) this.#rate.add(new Option(`${rate}×`, text));
    this.#rate.value = text;
  }
}

export function element<T extends HTMLElement>(id: string): T {
  return document.getElementById(id) as T;
}
