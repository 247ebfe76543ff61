// Curves over the time of a run: a few hundred points each, the newest at the right.

import uPlot from "uplot";

const kPoints = 600; // a minute of ten a second

export interface Reading {
  time: number; // s, any origin
  values: (number | null)[]; // one for each strip
}

export class Strips {
  readonly #plots: uPlot[];
  readonly #holder: HTMLElement;
  #readings: Reading[] = [];
  #drawn = true;

  constructor(holder: HTMLElement, titles: { title: string; unit: string }[]) {
    this.#holder = holder;
    const style = getComputedStyle(document.documentElement);
    const faint = () => style.getPropertyValue("--faint");
    const line = () => style.getPropertyValue("--line");
    const axis = { stroke: faint, grid: { stroke: line, width: 1 }, ticks: { show: false } };
    this.#plots = titles.map(
      ({ title, unit }) =>
        new uPlot(
          {
            title: `${title}${unit ? `, ${unit}` : ""}`,
            width: this.#width(),
            height: 110,
            legend: { show: false },
            cursor: { y: false },
            scales: { x: { time: false } },
            axes: [
              { ...axis, size: 22 },
              { ...axis, size: 52 },
            ],
            series: [{}, { stroke: () => "#4c7fb8", width: 1.5, points: { show: false } }],
          },
          [[], []],
          holder,
        ),
    );
    new ResizeObserver(() => this.#plots.forEach((plot) => plot.setSize({ width: this.#width(), height: 110 }))).observe(
      holder,
    );
    const frame = () => {
      requestAnimationFrame(frame);
      if (!this.#drawn) this.#draw();
    };
    frame();
  }

  add(reading: Reading): void {
    const last = this.#readings.at(-1);
    if (last && reading.time < last.time) this.clear(); // another run, or a look back
    this.#readings.push(reading);
    if (this.#readings.length > kPoints) this.#readings.shift();
    this.#drawn = false;
  }

  clear(): void {
    this.#readings = [];
    this.#drawn = false;
  }

  #width(): number {
    return Math.max(this.#holder.clientWidth, 100);
  }

  #draw(): void {
    this.#drawn = true;
    const times = this.#readings.map(({ time }) => time);
    this.#plots.forEach((plot, i) => plot.setData([times, this.#readings.map(({ values }) => values[i] ?? null)]));
  }
}
