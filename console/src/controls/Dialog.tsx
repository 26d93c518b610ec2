import { useLayoutEffect, useRef, type ReactNode } from "react";
import { useTranslation } from "react-i18next";
import { Button } from "./Button";

/** A modal dialog; the browser keeps the focus inside, and Escape closes it. */
export function Dialog({ title, close, children, kind = "plain" }: {
  title: string;
  close: () => void;
  children: ReactNode;
  kind?: "plain" | "danger";
}) {
  const { t } = useTranslation();
  const dialog = useRef<HTMLDialogElement>(null);
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
      onClick={(event) => {
        if (event.target === dialog.current) close();
      }}
    >
      <div className="dialog-body">
        <header>
          <h2>{title}</h2>
          <Button kind="quiet" icon="close" aria-label={t("action.close")} onClick={close} />
        </header>
        {children}
      </div>
    </dialog>
  );
}
