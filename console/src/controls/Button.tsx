import type { ButtonHTMLAttributes } from "react";
import { Icon, type IconName } from "./Icon";

interface Properties extends ButtonHTMLAttributes<HTMLButtonElement> {
  kind?: "primary" | "plain" | "quiet" | "danger";
  icon?: IconName;
  isBusy?: boolean;
}

/** A button of the console; while it is busy it cannot be pressed again. */
export function Button({ kind = "plain", icon, isBusy = false, children, ...rest }: Properties) {
  return (
    <button
      type="button"
      {...rest}
      className={`button button-${kind} ${rest.className ?? ""}`}
      disabled={rest.disabled === true || isBusy}
      aria-busy={isBusy}
    >
      {isBusy ? <span className="spinner" /> : icon && <Icon name={icon} />}
      {children !== undefined && <span>{children}</span>}
    </button>
  );
}
