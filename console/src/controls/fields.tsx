import { useId, type InputHTMLAttributes, type ReactNode, type SelectHTMLAttributes, type TextareaHTMLAttributes } from "react";

interface Common {
  label: string;
  hint?: string;
  error?: string | undefined;
}

/** A labelled line of text or number; the error belongs to it for screen readers too. */
export function TextField({ label, hint, error, ...rest }: Common & InputHTMLAttributes<HTMLInputElement>) {
  const id = useId();
  const note = error ?? hint;
  return (
    <div className={`field ${error ? "has-error" : ""}`}>
      <label htmlFor={id}>{label}</label>
      <input
        {...rest}
        id={id}
        aria-invalid={error !== undefined}
        aria-describedby={note === undefined ? undefined : `${id}-note`}
      />
      {note !== undefined && <small id={`${id}-note`}>{note}</small>}
    </div>
  );
}

/** A labelled text of several lines; the error belongs to it for screen readers too. */
export function TextArea({ label, hint, error, ...rest }: Common & TextareaHTMLAttributes<HTMLTextAreaElement>) {
  const id = useId();
  const note = error ?? hint;
  return (
    <div className={`field ${error ? "has-error" : ""}`}>
      <label htmlFor={id}>{label}</label>
      <textarea
        {...rest}
        id={id}
        aria-invalid={error !== undefined}
        aria-describedby={note === undefined ? undefined : `${id}-note`}
      />
      {note !== undefined && <small id={`${id}-note`}>{note}</small>}
    </div>
  );
}

/** A labelled choice. */
export function SelectField({ label, hint, error, children, ...rest }: Common &
  SelectHTMLAttributes<HTMLSelectElement> & { children: ReactNode }) {
  const id = useId();
  const note = error ?? hint;
  return (
    <div className={`field ${error ? "has-error" : ""}`}>
      <label htmlFor={id}>{label}</label>
      <select {...rest} id={id} aria-describedby={note === undefined ? undefined : `${id}-note`}>
        {children}
      </select>
      {note !== undefined && <small id={`${id}-note`}>{note}</small>}
    </div>
  );
}

/** A choice of a few, side by side. */
export function Segments<Value extends string>({ label, options, value, choose }: {
  label: string;
  options: readonly (readonly [Value, string])[];
  value: Value;
  choose: (value: Value) => void;
}) {
  const name = useId();
  return (
    <fieldset className="segments">
      <legend>{label}</legend>
      <div>
        {options.map(([key, text]) => (
          <label key={key} className={key === value ? "is-chosen" : ""}>
            <input type="radio" name={name} checked={key === value} onChange={() => choose(key)} />
            <span>{text}</span>
          </label>
        ))}
      </div>
    </fieldset>
  );
}
