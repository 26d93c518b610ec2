import { useCallback, useEffect, useRef, useState, type ReactNode } from "react";

const HOLD_MS = 1000;

/** A button for what must not happen by accident: it acts after one second of holding.
 *
 * Mouse, finger, or the keys Enter and Space; letting go earlier does nothing.
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
  const latest = useRef(act);
  latest.current = act;

  const release = useCallback(() => {
    if (timer.current !== null) clearTimeout(timer.current);
    timer.current = null;
    setHeld(false);
  }, []);
  const press = () => {
    if (disabled || timer.current !== null) return;
    setHeld(true);
    timer.current = window.setTimeout(() => {
      release();
      latest.current();
    }, HOLD_MS);
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
        if (event.button === 0) press();
      }}
      onPointerUp={release}
      onPointerLeave={release}
      onPointerCancel={release}
      onContextMenu={(event) => event.preventDefault()}
      onKeyDown={(event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        if (!event.repeat) press();
      }}
      onKeyUp={release}
      onBlur={release}
    >
      <span className="hold-progress" />
      <span className="hold-label">{children}</span>
      <span className="hold-hint">{hint}</span>
    </button>
  );
}
