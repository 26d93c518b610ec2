import { useId, useRef, useState } from "react";
import { useTranslation } from "react-i18next";
import { Button } from "./Button";

/** A text to be taken elsewhere, with a button that copies it. */
export function CopyField({ label, text }: { label: string; text: string }) {
  const { t } = useTranslation();
  const id = useId();
  const input = useRef<HTMLInputElement>(null);
  const [isCopied, setCopied] = useState(false);
  const copy = async () => {
    input.current?.select();
    try {
      await navigator.clipboard.writeText(text);
      setCopied(true);
    } catch {
      // Browsers give pages without TLS no clipboard, but copy what is selected
      setCopied(document.execCommand("copy"));
    }
  };
  return (
    <div className="form-line copy-field">
      <div className="field">
        <label htmlFor={id}>{label}</label>
        <input ref={input} id={id} value={text} readOnly onFocus={(event) => event.target.select()} />
      </div>
      <Button icon={isCopied ? "check" : "copy"} onClick={() => void copy()}>
        {t(isCopied ? "action.copied" : "action.copy")}
      </Button>
    </div>
  );
}
