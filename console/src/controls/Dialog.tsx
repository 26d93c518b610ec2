import { useLayoutEffect, useRef, type KeyboardEvent, type ReactNode } from "react";
import { useTranslation } from "react-i18next";
import { Button } from "./Button";
import { StopButton } from "./StopButton";

/** A modal dialog; the browser keeps the focus inside, and Escape closes it.
 *
 * What is outside of a modal dialog cannot be pressed, so each one has STOP in its header, which
 * stays where it is while the dialog scrolls. The stop orders themselves need none.
 */
export function Dialog({ title, close, children, kind = "plain", tools, onKeyDown }: {
  title: string;
  close: () => void;
  children: ReactNode;
  kind?: "plain" | "danger" | "stop" | "gallery";
  /** Controls beside the title. */
  tools?: ReactNode;
  onKeyDown?: (event: KeyboardEvent) => void;
}) {
  const { t } = useTranslation();
  const dialog = useRef<HTMLDialogElement>(null);
  /** Text that is selected beyond the edge, or a button that is left, is no press beside the dialog. */
  const isPressedBeside = useRef(false);
  // Closed before it leaves the page: the browser then gives the focus back to where it was
  useLayoutEffect(() => {
    const element = dialog.current;
    element?.showModal();
    return () => element?.close();
  }, []);
  return (
    <dialog
      ref={dialog}
      className={`dialog dialog-${kind}`}
      aria-label={title}
      onCancel={(event) => {
        event.preventDefault();
        close();
      }}
      onPointerDown={(event) => {
        isPressedBeside.current = event.target === dialog.current;
      }}
      onClick={(event) => {
        if (event.target === dialog.current && isPressedBeside.current) close();
      }}
      onKeyDown={onKeyDown}
    >
      <div className="dialog-head">
        <h2>{title}</h2>
        {tools}
        <Button kind="quiet" icon="close" aria-label={t("action.close")} onClick={close} />
        {kind !== "stop" && <StopButton />}
      </div>
      <div className="dialog-body">{children}</div>
    </dialog>
  );
}
