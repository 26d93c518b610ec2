/** Numbers with their units, as people read them. The edge server knows SI units only. */

import { inUnit } from "./entered";

export type System = "metric" | "imperial";

const FEET_PER_M = 3.28084;
const INCHES_PER_M = 39.3701;
const MPH_PER_M_S = 2.23694;
const KMH_PER_M_S = 3.6;
const M_PER_MILE = 1609.344;
const M2_PER_HA = 10_000;
const M2_PER_ACRE = 4046.856;
/** No vehicle is higher or faster, and nothing takes a hundred years: a figure beyond has been garbled, and would be as
 *  wide as the screen. */
const HIGHEST_M = 100_000;
const FASTEST_M_S = 1_000;
const LONGEST_MS = 36_500 * 86_400_000;
/** A smaller area is shown in m² or ft². */
const SMALL_M2 = 1_000;
/** Of hectares and acres. */
const TENTHS_FROM = 10;

/** By language and digits: to make one takes longer than to draw the number. */
const formats = new Map<string, Intl.NumberFormat>();

/** Languages that write a whole number below a thousand as JavaScript does. */
const PLAIN = /^(en|es)\b/;

function rounded(value: number, digits: number, language: string): string {
  if (digits === 0 && Math.abs(value) < 999.5 && PLAIN.test(language)) {
    // The browser takes a while to make its first format, in the middle of the first load
    return String(Math.sign(value) * Math.round(Math.abs(value)));
  }
  const key = `${language} ${digits}`;
  let format = formats.get(key);
  if (format === undefined) {
    format = new Intl.NumberFormat(language, { minimumFractionDigits: digits, maximumFractionDigits: digits });
    formats.set(key, format);
  }
  return format.format(value);
}

function isWithin(value: number | null | undefined, largest: number): value is number {
  return typeof value === "number" && Math.abs(value) <= largest;
}

/** Languages that write 1.5 as JavaScript does. */
const PLAIN_POINT = /^en\b/;

/** In each place the same; the region decides between 12 and 24 hours. */
const HOUR_AND_MINUTE = { hour: "2-digit", minute: "2-digit" } as const;

/** The language as the browser's own region writes its times, where the browser names one: "en-GB" for "en". */
function withRegion(language: string): string {
  return navigator.languages.find((one) => one.startsWith(`${language}-`)) ?? language;
}

/** Formats values in one system of units and one language. */
export class Units {
  constructor(
    readonly system: System,
    readonly language: string,
  ) {}

  height(metres: number | null | undefined): string {
    if (!isWithin(metres, HIGHEST_M)) return "–";
    const isImperial = this.system === "imperial";
    // A drone on the ground is 0 high: in feet the noise of its height would show
    const shown_m = Math.abs(metres) < 0.5 ? 0 : metres;
    return `${this.#write(isImperial ? shown_m * FEET_PER_M : shown_m, 0)} ${isImperial ? "ft" : "m"}`;
  }

  distance(metres: number | null | undefined): string {
    if (metres === null || metres === undefined) return "–";
    if (this.system === "imperial") {
      const isLong = metres >= M_PER_MILE / 4;
      return isLong ? `${this.#write(metres / M_PER_MILE, 2)} mi` : this.height(metres);
    }
    return metres >= 1000 ? `${this.#write(metres / 1000, 2)} km` : this.height(metres);
  }

  speed(metresPerSecond: number | null | undefined): string {
    if (!isWithin(metresPerSecond, FASTEST_M_S)) return "–";
    const isImperial = this.system === "imperial";
    const value = metresPerSecond * (isImperial ? MPH_PER_M_S : KMH_PER_M_S);
    return `${this.#write(value, 0)} ${isImperial ? "mph" : "km/h"}`;
  }

  /** An amount of data in MiB or GiB, as the edge server's settings count it. */
  data(bytes: number): string {
    const mebibytes = bytes / 2 ** 20;
    return mebibytes >= 1024
      ? `${this.#write(mebibytes / 1024, 1)} GiB`
      : `${this.#write(mebibytes, mebibytes < 10 ? 1 : 0)} MiB`;
  }

  /** A measured value in the unit in which it was reported, or in that of the system. */
  measured(value: number, unit: string): string {
    switch (unit) {
      case "Cel":
      case "C":
        return this.system === "imperial"
          ? `${this.#write(value * 1.8 + 32, 1)} °F`
          : `${this.#write(value, 1)} °C`;
      case "m/s":
        return this.system === "imperial"
          ? `${this.#write(value * MPH_PER_M_S, 1)} mph`
          : `${this.#write(value, 1)} m/s`;
      case "deg":
        return `${this.#write(value, 0)}°`;
      case "lx":
        return `${this.#write(value, 0)} lx`;
      default:
        return unit === "1" ? this.#write(value, 2) : `${this.#write(value, 1)} ${unit}`;
    }
  }

  area(squareMetres: number | null | undefined): string {
    if (squareMetres === null || squareMetres === undefined) return "–";
    const isImperial = this.system === "imperial";
    if (squareMetres < SMALL_M2) {
      const value = isImperial ? squareMetres * FEET_PER_M ** 2 : squareMetres;
      return `${this.#write(value, 0)} ${isImperial ? "ft²" : "m²"}`;
    }
    const large = squareMetres / (isImperial ? M2_PER_ACRE : M2_PER_HA);
    return `${this.#write(large, large < TENTHS_FROM ? 2 : 1)} ${isImperial ? "ac" : "ha"}`;
  }

  /** Units in which a person enters a height, a length of some metres, a speed [m/s] and a resolution [m]. */
  get heightInput() {
    return this.system === "imperial"
      ? { symbol: "ft", factor: FEET_PER_M, digits: 0 }
      : { symbol: "m", factor: 1, digits: 1 };
  }

  get lengthInput() {
    return this.system === "imperial"
      ? { symbol: "ft", factor: FEET_PER_M, digits: 1 }
      : { symbol: "m", factor: 1, digits: 2 };
  }

  get speedInput() {
    return this.system === "imperial"
      ? { symbol: "mph", factor: MPH_PER_M_S, digits: 1 }
      : { symbol: "km/h", factor: KMH_PER_M_S, digits: 1 };
  }

  /** A value in the unit in which a person enters it, without the unit. */
  entered(value: number, { factor, digits }: { factor: number; digits: number }): string {
    return this.#write(value * factor, digits);
  }

  get resolutionInput() {
    return this.system === "imperial"
      ? { symbol: "in/px", factor: INCHES_PER_M, digits: 2 }
      : { symbol: "cm/px", factor: 100, digits: 2 };
  }

  /** What the language writes before decimals. */
  get decimalMark(): string {
    return PLAIN_POINT.test(this.language) ? "." : this.#write(1.1, 1).slice(1, 2);
  }

  /** A number as text, such as "1.5", as the language writes it. */
  written(text: string): string {
    return text.replace(".", this.decimalMark);
  }

  /** A speed in the unit and with the digits in which it is entered. */
  exactSpeed(metresPerSecond: number): string {
    const { symbol } = this.speedInput;
    return `${this.written(inUnit(metresPerSecond, this.speedInput))} ${symbol}`;
  }

  count(number: number | null | undefined): string {
    return number === null || number === undefined ? "–" : this.#write(number, 0);
  }

  percentage(fraction: number | null | undefined): string {
    if (fraction === null || fraction === undefined) return "–";
    return `${this.#write(fraction * 100, 0)} %`;
  }

  /** A duration such as "12 s", "4 min", "2 h 5 min" or "3 d". */
  duration(milliseconds: number): string {
    if (!(milliseconds <= LONGEST_MS)) return "–";
    const seconds = Math.max(0, Math.round(milliseconds / 1000));
    if (seconds < 60) return `${seconds} s`;
    const minutes = Math.floor(seconds / 60);
    if (minutes < 60) return `${minutes} min`;
    const hours = Math.floor(minutes / 60);
    if (hours < 48) return `${hours} h ${minutes % 60} min`;
    return `${Math.floor(hours / 24)} d`;
  }

  /** A duration to the second below an hour: "1 min 54 s". */
  elapsed(milliseconds: number): string {
    const seconds = Math.max(0, Math.round(milliseconds / 1000));
    const isLong = seconds >= 60 && seconds < 3600 && seconds % 60 > 0;
    const minutes = this.duration((isLong ? seconds - (seconds % 60) : seconds) * 1000);
    return isLong ? `${minutes} ${seconds % 60} s` : minutes;
  }

  /** Date and time, in the browser's time zone. */
  time(stamp: string | null | undefined): string {
    if (!stamp) return "–";
    return new Date(stamp).toLocaleString(withRegion(this.language), {
      day: "numeric",
      month: "short",
      ...HOUR_AND_MINUTE,
    });
  }

  /** Time of day to the second, in the browser's time zone; the moment is a text or [ms since 1970].
   *
   * "–" for a moment beyond the calendar: older edge servers have stored any time of a measurement.
   */
  clock(moment: string | number): string {
    const date = new Date(moment);
    if (Number.isNaN(date.getTime())) return "–";
    return date.toLocaleTimeString(withRegion(this.language), { ...HOUR_AND_MINUTE, second: "2-digit" });
  }

  #write(value: number, digits: number): string {
    return rounded(Object.is(Math.round(value), -0) ? 0 : value, digits, this.language);
  }
}
