import { use, type ComponentType, type ReactNode } from "react";
import { Boundary } from "./Boundary";
import { LoadedOnce } from "./loaded_once";

interface Loaded<Properties> {
  default: ComponentType<Properties>;
}

/** A component whose code is loaded when it is first shown, or before by `preload`. */
export interface Part<Properties> {
  (properties: Properties): ReactNode;
  /** Loads the code; false if that is not possible now. */
  preload: () => Promise<boolean>;
}

/** Makes a part of the console with a file of its own; where it fails, the rest of the page stays.
 *
 * Unlike React's `lazy` it can be loaded again after a failure.
 */
export function part<Properties extends object>(load: () => Promise<Loaded<Properties>>): Part<Properties> {
  const code = new LoadedOnce(load);
  function Shown(properties: Properties) {
    const { default: Component } = code.value ?? use(code.promise());
    return <Component {...properties} />;
  }
  const Bounded = (properties: Properties) => (
    <Boundary retry={() => code.forgetFailure()}>
      <Shown {...properties} />
    </Boundary>
  );
  return Object.assign(Bounded, { preload: () => code.preload() });
}
