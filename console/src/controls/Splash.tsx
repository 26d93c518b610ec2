import { useWaitingText } from "./use_waiting_text";

/** A quiet page while the console finds out who is signed in. */
export function Splash() {
  const { text, isLong } = useWaitingText();
  return (
    <div className="splash" role="status">
      <span className="spinner spinner-large" />
      <p className={isLong ? "muted" : "visually-hidden"}>{text}</p>
    </div>
  );
}
