/** How strongly a map shows: 0.1 to 1. */
export function OpacitySlider({ label, value, change }: {
  label: string;
  value: number;
  change: (value: number) => void;
}) {
  return (
    <input
      type="range"
      min={0.1}
      max={1}
      step={0.05}
      value={value}
      aria-label={label}
      onChange={(event) => change(Number(event.target.value))}
    />
  );
}
