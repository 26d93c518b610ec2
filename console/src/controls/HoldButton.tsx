import { useCallback, useEffect, useRef, useState, type ReactNode } from "react";

const HOLD_MS = 1000;

/** A button for what must not happen by accident: it acts after one second of holding.
 *
 * Mouse, finger, or the keys Enter and Space; letting go earlier does nothing. A browser that is busy
 * learns late of both: what counts is when the button was pressed and released, not when it learns it.
 */
export function HoldButton({ children, hint, disabled = false, act, className = "" }: {
  children: ReactNode;
  hint: string;
  disabled?: boolean;
  act: () => void;
  className?: string;
}) {
  const [isHeld, setHeld] = useState(false);
  const timer = useRef<number | null>(null);
  const pressedAt_ms = useRef(0);
  const latest = useRef(act);
  latest.current = act;

  const release = useCallback(() => {
    if (timer.current !== null) clearTimeout(timer.current);
    timer.current = null;
    setHeld(false);
  }, []);
  const finish = useCallback(() => {
    release();
    latest.current();
  }, [release]);
  const press = (at_ms: number) => {
    if (disabled || timer.current !== null) return;
    setHeld(true);
    pressedAt_ms.current = at_ms;
    timer.current = window.setTimeout(finish, HOLD_MS);
  };
  const letGo = (at_ms: number) => {
    if (timer.current !== null && at_ms - pressedAt_ms.current >= HOLD_MS) finish();
    else release();
  };
  useEffect(() => release, [release]);
  useEffect(() => {
    if (disabled) release();
  }, [disabled, release]);

  return (
    <button
      type="button"
      className={`hold ${isHeld ? "is-held" : ""} ${className}`}
      disabled={disabled}
      onPointerDown={(event) => {
        if (event.button === 0) press(event.timeStamp);
      }}
      onPointerUp={(event) => letGo(event.timeStamp)}
      onPointerLeave={release}
      onPointerCancel={release}
      onContextMenu={(event) => event.preventDefault()}
      onKeyDown={(event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        if (!event.repeat) press(event.timeStamp);
      }}
      onKeyUp={(event) => letGo(event.timeStamp)}
      onBlur={release}
    >
      <span className="hold-progress" />
      <span className="hold-label">{children}</span>
      <span className="hold-hint">{hint}</span>
    </button>
  );
}
